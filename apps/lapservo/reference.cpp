#include <filesystem>
#include <memory>
#include <string>

#include "apps/lapservo/bash_completion.h"
#include "apps/lapservo/command_description.h"
#include "apps/lapservo/manual_page.h"
#include "apps/lapservo/reference_markdown.h"
#include "apps/lapservo/subcommands.h"
#include "lapservo/core/atomic_file.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  AtomicFile file(path);
  file.stream() << text;
  file.commit();
}

int write_reference(const CLI::App& app, const fs::path& out) {
  const CommandDescription root = describe_command(app);
  for (const CommandDescription* command : all_commands(root))
    write(out / "man1" / (command->name('-') + ".1"), manual_page(*command, root, LAPSERVO_VERSION));
  write(out / "completions" / "lapservo", bash_completion(root));
  write(out / "cli.md", reference_markdown(root));
  return 0;
}

}  // namespace

void add_reference(CLI::App& app, Run& run_later) {
  auto out = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "reference",
      "Write what the command line takes as manual pages, completion for bash and a page of the documentation.");
  command->group("");  // for those who package it
  command->add_option("--out", *out, "Folder for man1/*.1, completions/lapservo and cli.md")->required();
  Command(command).runs(run_later, [&app, out] { return write_reference(app, *out); });
}

}  // namespace lapservo::app
