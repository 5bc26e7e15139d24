#include "lapservo/core/yaml_field.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/input_file.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

constexpr std::size_t max_file_bytes = 1 << 20;

// yaml-cpp 0.7 follows 500 levels (its DepthGuard), each several frames of the stack; no file of ours needs 16.
bool nests_too_deeply(std::string_view yaml) {
  int depth = 0;
  for (const char c : yaml) {
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (depth > 16) return true;
  }
  constexpr std::string_view blanks = " \n\t\r";
  std::size_t run = 0;  // "- - - -" and "? ? ?" and ": : :" nest too; a ruler of dashes does not
  for (std::size_t i = 0; i < yaml.size(); ++i) {
    const bool indicator = (yaml[i] == '-' || yaml[i] == '?' || yaml[i] == ':') &&
                           (i + 1 == yaml.size() || blanks.find(yaml[i + 1]) != std::string_view::npos);
    if (indicator) {
      if (++run > 64) return true;
    } else if (blanks.find(yaml[i]) == std::string_view::npos) {
      run = 0;
    }
  }
  return false;
}

class Unheard : public YAML::EventHandler {
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

// Not by YAML::LoadAll, which never ends where a token is left over between documents, as of ", a".
bool holds_several_documents(const std::string& yaml) {
  std::istringstream stream(yaml);
  YAML::Parser parser(stream);
  Unheard events;
  return parser.HandleNextDocument(events) && parser.HandleNextDocument(events);
}

// yaml-cpp complains of both at another place.
std::string odd_blank_in(std::string_view yaml) {
  const std::size_t at = std::min(yaml.find('\t'), yaml.find("\xc2\xa0"));
  if (at == std::string_view::npos) return "";
  return "line " + std::to_string(1 + std::count(yaml.begin(), yaml.begin() + static_cast<std::ptrdiff_t>(at), '\n')) +
         " has a tab or a no-break space, write spaces; ";
}

std::string syntax_problem(const YAML::Exception& error) {
  if (error.mark.is_null()) return error.msg;
  return "line " + std::to_string(error.mark.line + 1) + ", column " + std::to_string(error.mark.column + 1) + ": " +
         error.msg;
}

}  // namespace

std::string read_yaml(const fs::path& path) {
  const std::string text = read_input(path, max_file_bytes, "a YAML file");
  if (text.empty()) throw InputError(path.string(), "is empty, expected a YAML file");
  return text;
}

YamlField YamlField::read(const fs::path& path, std::string_view kind) {
  return parse(read_yaml(path), path.string(), kind);
}

YamlField YamlField::parse(std::string_view yaml, const std::string& source, std::string_view kind) {
  if (yaml.size() > max_file_bytes) throw InputError(source, "is larger than 1 MiB, expected a " + std::string(kind));
  if (nests_too_deeply(yaml))
    throw InputError(source, yaml.find('\0') != std::string_view::npos
                                 ? "holds NUL bytes as images do, expected a " + std::string(kind)
                                 : "nests more deeply than a " + std::string(kind) + " does");
  try {
    const std::string text(yaml);
    if (holds_several_documents(text))
      throw InputError(source, "holds several documents, expected one: no line of three dashes in the midst of a " +
                                   std::string(kind));
    return {source, "", YAML::Load(text)};
  } catch (const YAML::Exception& error) {
    throw InputError(
        source, "is not YAML: " + odd_blank_in(yaml) + syntax_problem(error) + ", expected a " + std::string(kind));
  }
}

YamlField::YamlField(std::string source, std::string path, const YAML::Node& node)
    : source_(std::move(source)), path_(std::move(path)), node_(std::make_shared<const YAML::Node>(node)) {}

YamlField YamlField::at_key(const std::string& key, const YAML::Node& node) const {
  return {source_, path_.empty() ? key : path_ + "." + key, node};
}

void YamlField::fail(std::string_view value, std::string_view expected) const {
  throw InputError(source_, path_.empty() ? "file" : path_, value, expected);
}

void YamlField::fail_within(const FieldProblem& problem) const {
  throw InputError(source_, path_ + "." + problem.field, problem.value, problem.expectation);
}

std::string YamlField::value_text() const {
  if (!present()) return "missing";
  if (node_->IsScalar()) return node_->Scalar().empty() ? "''" : node_->Scalar();
  return node_->IsSequence() ? "a list of " + std::to_string(node_->size()) : "a map";
}

std::string YamlField::yaml_of(const std::string& key) const {
  YAML::Emitter text;
  text << YAML::BeginMap << YAML::Key << key << YAML::Value << *node_ << YAML::EndMap;
  return text.c_str() + std::string("\n");
}

bool YamlField::present() const {
  return node_->IsDefined() && !node_->IsNull();
}

bool YamlField::is_scalar() const {
  return present() && node_->IsScalar();
}

bool YamlField::is_map() const {
  return present() && node_->IsMap();
}

YamlField YamlField::operator[](const std::string& key) const {
  if (!present() || !node_->IsMap()) fail(value_text(), "a map with '" + key + "'");
  return at_key(key, (*node_)[key]);
}

std::vector<std::pair<std::string, YamlField>> YamlField::entries(std::string_view expected) const {
  if (!present() || !node_->IsMap()) fail(value_text(), expected);
  std::vector<std::pair<std::string, YamlField>> all;
  for (const auto& entry : *node_) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
    all.emplace_back(key, at_key(key, entry.second));
  }
  return all;
}

std::vector<YamlField> YamlField::list(std::string_view expected) const {
  if (!present() || !node_->IsSequence()) fail(value_text(), expected);
  std::vector<YamlField> items;
  for (std::size_t i = 0; i < node_->size(); ++i)
    items.push_back({source_, path_ + "[" + std::to_string(i) + "]", (*node_)[i]});
  return items;
}

std::string YamlField::text(std::string_view expected) const {
  if (!is_scalar() || node_->Scalar().empty()) fail(value_text(), expected);
  return node_->Scalar();
}

double YamlField::number(std::string_view expected) const {
  std::string text = is_scalar() ? node_->Scalar() : "";
  if (const auto value = parse_finite(text)) return *value;
  if (const auto comma = text.find(','); comma != std::string::npos) text[comma] = '.';
  fail(value_text(), parse_finite(text) ? text + ", with a decimal point" : std::string(expected));
}

bool YamlField::boolean() const {
  constexpr auto expected = "true or false";
  const std::string word = text(expected);
  if (word != "true" && word != "false") fail(word, expected);
  return word == "true";
}

double YamlField::number_between(double low, double high, std::string_view expected) const {
  const double value = number(expected);
  if (!(value >= low && value <= high)) fail(value_text(), expected);
  return value;
}

}  // namespace lapservo::internal
