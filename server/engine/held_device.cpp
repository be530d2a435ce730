#include "server/engine/held_device.h"

#include <algorithm>
#include <future>

#include "base/fields.h"
#include "daq/registry.h"

namespace ferrobench::server {

namespace {

constexpr double usual_slew = daq::Limits{}.stop_slew;
// Opening loads the unit's logic and brings its output to zero, which takes 10 s at most as the amplifier can
// do it; the rest is for a busy machine.
constexpr std::chrono::seconds opening_patience{60};

}  // namespace

HeldDevice::HeldDevice(std::shared_ptr<BenchLink> link, const std::string& driver,
                       const nlohmann::json& config)
    : link_(std::move(link)), number_(link_->new_number()) {
  facts_ = link_->ask<daq::DeviceFacts>(bench::Open{.device = number_, .driver = driver, .config = config},
                                        opening_patience);
  keep_replay();
}

HeldDevice::HeldDevice(std::shared_ptr<daq::Device> device)
    : link_(BenchLink::to_thread({})), number_(link_->new_number()), facts_(daq::facts_of(*device)) {
  link_->host()->add_device(number_, std::move(device));
  keep_replay();
}

HeldDevice::~HeldDevice() {
  if (closed_ || link_->lost()) return;
  try {
    close(usual_slew);
  } catch (const Error&) {  // the bench has died, and its successor brings it to zero
  }
}

const daq::DeviceFacts& HeldDevice::look() {
  facts_ = link_->ask<daq::DeviceFacts>(bench::Look{.device = number_});
  return facts_;
}

void HeldDevice::close(double slew) {
  closed_ = true;
  if (link_->lost()) return;  // the successor brings it to zero
  link_->order(bench::Close{.device = number_, .slew = slew});
}

daq::SelftestReport HeldDevice::selftest(double rate, const std::function<std::string()>& stop_wanted) {
  auto report = std::async(std::launch::async, [&] {
    return link_->ask<daq::SelftestReport>(bench::Selftest{.device = number_, .rate = rate});
  });
  while (report.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready)
    if (const auto reason = stop_wanted(); !reason.empty()) link_->tell(bench::StopSelftest{reason});
  return report.get();
}

void HeldDevice::keep_replay() {
  if (link_->host() == nullptr) return;
  auto device = link_->host()->device(number_);
  if (device && daq::replay_source(*device) != nullptr) replay_ = std::move(device);
}

nlohmann::json configuration_for_zero(const nlohmann::json& info) {
  if (!info.is_object() || !info.contains("configuration")) return nullptr;
  const auto kinds = daq::device_kinds();
  const auto kind = std::ranges::find(kinds, text_at(info, "driver"), &daq::DeviceKind::name);
  if (kind == kinds.end() || !kind->keeps_output) return nullptr;
  auto out = info.at("configuration");
  // That very unit, whatever else is attached now.
  if (out.is_object() && info.contains("serial_number")) out["serial_number"] = info["serial_number"];
  return out;
}

}  // namespace ferrobench::server
