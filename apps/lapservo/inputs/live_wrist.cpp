#include "apps/lapservo/inputs/live_wrist.h"

#include <utility>

#include "apps/lapservo/inputs/transports.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::app {
using namespace internal;

LiveWrist::LiveWrist(const std::string& topic) {
  const Address address = address_of(topic, "--joints");
  transport_ = make_transport(address.transport, "lapservo_wrist", "--joints");
  subscription_ = transport_->subscribe_joints(address.name, [this](JointMessage&& message) {
    const std::lock_guard lock(mutex_);
    history_.add(std::move(message), clock_.now_s());
  });
}

std::vector<double> LiveWrist::at_exposure(const Instrument& instrument, double arrival_s) const {
  // A longer delay, or one below 0, is that of a recording by two clocks.
  constexpr double longest_s = WristHistory::kept_s - WristHistory::near_s;
  const double delay_s = instrument.image_delay_s.value_or(0);
  const double exposure_s = arrival_s - (delay_s >= 0 && delay_s <= longest_s ? delay_s : 0);
  const std::lock_guard lock(mutex_);
  return history_.at(wrist_names(instrument.tool), exposure_s);
}

}  // namespace lapservo::app
