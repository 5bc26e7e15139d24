#include "transports/ros2/reading.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

namespace lapservo::internal {
namespace {

constexpr dds_duration_t patience = DDS_SECS(1);

struct Offer {
  dds_instance_handle_t participant = 0;      // whose it is
  bool is_reliable = false, is_kept = false;  // kept: for readers that come later

  bool meets(Delivery demanded) const {
    return demanded == Delivery::best_effort || (is_reliable && (is_kept || demanded != Delivery::latched));
  }
};

// Nothing of a writer that is gone.
std::optional<Offer> offer_of(dds_entity_t reader, dds_instance_handle_t writer) {
  dds_builtintopic_endpoint_t* const endpoint = dds_get_matched_publication_data(reader, writer);
  if (!endpoint) return std::nullopt;
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  dds_qget_reliability(endpoint->qos, &reliability, nullptr);
  dds_qget_durability(endpoint->qos, &durability);
  const dds_instance_handle_t participant = endpoint->participant_instance_handle;
  dds_builtintopic_free_endpoint(endpoint);
  return Offer{participant, reliability == DDS_RELIABILITY_RELIABLE, durability >= DDS_DURABILITY_TRANSIENT_LOCAL};
}

bool has_volatile_publisher(dds_entity_t reader) {
  std::array<dds_instance_handle_t, 16> writers{};
  const int count = dds_get_matched_publications(reader, writers.data(), writers.size());
  return std::any_of(writers.begin(), writers.begin() + std::clamp<int>(count, 0, writers.size()), [&](auto writer) {
    const auto offer = offer_of(reader, writer);
    return offer && !offer->is_kept;
  });
}

}  // namespace

Reading::Reading(std::shared_ptr<DdsNode> node, const std::string& topic, const dds_topic_descriptor_t& type,
                 const std::vector<Delivery>& deliveries, std::optional<int> depth, Taken taken)
    : node_(std::move(node)),
      topic_(topic),
      deliveries_(deliveries),
      taken_(std::move(taken)),
      awaited_(deliveries.front() == Delivery::latched),
      waitset_(dds_create_waitset(node_->participant())) {
  dds_waitset_attach(waitset_, waitset_, 0);
  for (const Delivery delivery : deliveries) {
    readers_.push_back(node_->create_reader(topic, type, delivery, depth));
    const dds_entity_t condition = dds_create_readcondition(readers_.back(), DDS_ANY_STATE);
    dds_waitset_attach(waitset_, condition, 0);
  }
  thread_ = std::thread([this] { work(); });
}

Reading::~Reading() {
  dds_waitset_set_trigger(waitset_, true);
  thread_.join();
  dds_delete(waitset_);
  for (const dds_entity_t reader : readers_) node_->remove(reader);
}

void Reading::work() {
  while (true) {
    const bool silent = dds_waitset_wait(waitset_, nullptr, 0, awaited_ ? patience : DDS_INFINITY) == 0;
    if (dds_triggered(waitset_) > 0) return;
    if (silent) look_for_silent_publisher();
    for (std::size_t reader = 0; reader < readers_.size(); ++reader) take(reader);
  }
}

// A message that is sent once should reach later subscribers.
void Reading::look_for_silent_publisher() {
  if (!has_volatile_publisher(readers_.back()) || ++silences_ < 2) return;  // the first may have just come
  awaited_ = false;
  std::fprintf(stderr,
               "DDS: %s: its publisher is volatile and has said nothing since: let it say it again, or latch it "
               "(transient local)\n",
               topic_.c_str());
}

void Reading::take(std::size_t reader) {
  constexpr int at_once = 64;
  std::array<void*, at_once> samples{};
  std::array<dds_sample_info_t, at_once> infos;
  const int count = dds_take(readers_[reader], samples.data(), infos.data(), at_once, at_once);
  if (count <= 0) return;
  awaited_ = false;
  for (int i = 0; i < count; ++i) {
    if (!infos[i].valid_data) continue;
    const Writer& writer = known(reader, infos[i].publication_handle);
    if (writer.reader == reader) taken_(samples[i], writer.program);
  }
  dds_return_loan(readers_[reader], samples.data(), count);
}

// A writer's message reaches every reader whose demand the writer meets, each on its own way. The most demanding of
// them counts, and for good: they are not in step. Nothing is known of a writer that is gone; then the first one counts
// that is found to hold a message of it: the more demanding ones, taken from before, held none.
const Reading::Writer& Reading::known(std::size_t reader, dds_instance_handle_t writer) {
  const auto one = writers_.find(writer);
  if (one != writers_.end()) return one->second;
  const auto offer = offer_of(readers_[reader], writer);
  const auto met = std::find_if(deliveries_.begin(), deliveries_.end(),
                                [&](Delivery delivery) { return offer && offer->meets(delivery); });
  const std::size_t counts = met == deliveries_.end() ? reader : static_cast<std::size_t>(met - deliveries_.begin());
  return writers_.emplace(writer, Writer{counts, offer ? offer->participant : writer}).first->second;
}

}  // namespace lapservo::internal
