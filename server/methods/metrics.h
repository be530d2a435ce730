// What the daemon tells Prometheus (GET /metrics): of runs, rows, queues, clients, calls and the disk.
#pragma once

#include <memory>
#include <string>

#include "server/engine/engine.h"
#include "server/net/server.h"

namespace ferrobench::server {

class Metrics {
 public:
  explicit Metrics(Engine& engine);
  ~Metrics();

  // For any thread; nobody waits.
  void call(const Call& call);
  void refusal(const Refusal& refusal);

  // Prometheus text format 0.0.4.
  std::string text(const Load& load, std::uint64_t audit_lines_lost) const;

 private:
  struct Counters;
  Engine& engine_;
  std::unique_ptr<Counters> counters_;
};

}  // namespace ferrobench::server
