// The benches of an engine: the process that holds the voltage, started when it is first needed, and a thread
// for replays. Where the process has died, another one brings to zero what it may have left up.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/engine/hazards.h"
#include "server/engine/held_device.h"

namespace ferrobench::server {

class Benches {
 public:
  // `open`: where it is given, devices are opened by it and in this process.
  Benches(bench::Opener open, Hazards& hazards);
  ~Benches();

  // Throws Error(invalid_params | not_found) for a configuration that is none before any bench hears of it,
  // what opening throws, Error(device_unavailable).
  std::shared_ptr<HeldDevice> open(const std::string& kind, const nlohmann::json& config);
  // A bench that its server has left, with the run that it has, in the folder. Null if there is none.
  std::shared_ptr<BenchLink> take_over(const std::string& folder);
  // Starts the bench process: what it lacks of memory locks and priority, "" if it has both.
  std::string start() { return process()->ready().lacks; }

 private:
  // What holds an output, or held it when it was taken over.
  struct Held {
    std::weak_ptr<HeldDevice> device{};
    bool taken_over = false;
    std::string driver{}, unit{};
    nlohmann::json configuration{};
  };
  std::shared_ptr<BenchLink> process();
  void keep(Held held);
  void attend(const std::shared_ptr<BenchLink>& link);
  std::string bring_to_zero(const BenchLink* died);

  bench::Opener open_;
  Hazards& hazards_;
  std::mutex mutex_;  // over what follows
  std::shared_ptr<BenchLink> process_, thread_;
  std::vector<Held> held_;
  std::vector<std::shared_ptr<BenchLink>> dead_;  // their threads are still at work in bring_to_zero()
};

// Opens the device, which brings its output to zero, and closes it. Throws Error if it may not be there.
void bring_to_zero(const std::shared_ptr<BenchLink>& link, const std::string& driver,
                   const nlohmann::json& configuration);

}  // namespace ferrobench::server
