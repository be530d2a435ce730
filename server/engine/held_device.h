// A device that is open on a bench (bench_link.h), as the server knows it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "daq/device_facts.h"
#include "daq/replay/replay_device.h"
#include "daq/selftest.h"
#include "server/engine/bench_link.h"

namespace ferrobench::server {

class HeldDevice {
 public:
  // Opens it there. Throws what opening throws, and Error(device_lost).
  HeldDevice(std::shared_ptr<BenchLink> link, const std::string& driver, const nlohmann::json& config);
  // One of this program, on a bench of its own in a thread.
  explicit HeldDevice(std::shared_ptr<daq::Device> device);
  ~HeldDevice();  // closes it, unless a run had its last use
  HeldDevice(const HeldDevice&) = delete;
  HeldDevice& operator=(const HeldDevice&) = delete;

  const daq::DeviceFacts& facts() const { return facts_; }  // as they were when last looked at
  const daq::DeviceFacts& look();                           // as they are
  // Brings its output to zero first: Error(device_lost) says so if it may not be there; it is closed then,
  // too.
  void close(double slew);
  // `stop_wanted`: why the test must end, or "". Errors as daq::selftest.
  daq::SelftestReport selftest(double rate, const std::function<std::string()>& stop_wanted);
  // Of a replay, which is in this process; null if it measures.
  const daq::ReplaySource* replay() const { return replay_ ? daq::replay_source(*replay_) : nullptr; }

  const std::shared_ptr<BenchLink>& link() const { return link_; }
  std::uint32_t number() const { return number_; }
  void used_up() { closed_ = true; }  // the bench closes it when the run is over

 private:
  void keep_replay();

  std::shared_ptr<BenchLink> link_;
  std::uint32_t number_;
  daq::DeviceFacts facts_;
  std::shared_ptr<const daq::Device> replay_;
  bool closed_ = false;
};

// Where a device whose output stays where it is can be opened again: its driver, and its configuration with
// the serial number of that very unit. Null for one that holds no voltage when its program has died. `info`:
// as in a recording.
nlohmann::json configuration_for_zero(const nlohmann::json& info);

}  // namespace ferrobench::server
