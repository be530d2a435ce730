#include "server/methods/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include "recordings/format/version.h"

namespace ferrobench::server {
namespace {

using prometheus::MetricType;
using Families = std::vector<prometheus::MetricFamily>;
using Labels = std::vector<prometheus::ClientMetric::Label>;

void put(Families& out, MetricType type, const char* name, const char* help,
         const std::vector<std::pair<Labels, double>>& values) {
  auto& family = out.emplace_back();
  family.name = name;
  family.help = help;
  family.type = type;
  for (const auto& [labels, value] : values) {
    auto& metric = family.metric.emplace_back();
    metric.label = labels;
    (type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = value;
  }
}
void put(Families& out, MetricType type, const char* name, const char* help, double value) {
  put(out, type, name, help, {{{}, value}});
}

void put_runs(Families& out, const Engine& engine) {
  const auto status = engine.status();
  const auto totals = engine.totals();
  std::vector<std::pair<Labels, double>> states;
  for (const auto& [state, name] : enum_names(RunState{}))
    states.push_back({{{"state", std::string(name)}}, state == status.state ? 1.0 : 0.0});
  put(out, MetricType::Gauge, "ferrobench_run_state", "1 for the state of the latest run", states);
  put(out, MetricType::Gauge, "ferrobench_output_at_zero",
      "1 if no run is under way and the last one left the output at zero", status.output_at_zero ? 1 : 0);
  put(out, MetricType::Counter, "ferrobench_runs_total", "Runs that are over, by outcome",
      {{{{"outcome", "complete"}}, static_cast<double>(totals.complete)},
       {{{"outcome", "aborted"}}, static_cast<double>(totals.aborted)}});
  put(out, MetricType::Counter, "ferrobench_rows_acquired_total", "Rows of samples acquired",
      static_cast<double>(totals.rows));
  put(out, MetricType::Counter, "ferrobench_rows_on_disk_total", "Rows that a power cut cannot take any more",
      static_cast<double>(totals.rows_on_disk));
  put(out, MetricType::Gauge, "ferrobench_acquisition_queue_blocks",
      "Blocks of samples that wait to be written", static_cast<double>(engine.queued_blocks()));
}

void put_clients(Families& out, const Hub& hub, const Load& load) {
  const auto counts = hub.counts();
  std::vector<std::pair<Labels, double>> subscribers;
  for (const auto& [topic, count] : counts.subscribers)
    subscribers.push_back({{{"topic", topic}}, static_cast<double>(count)});
  put(out, MetricType::Gauge, "ferrobench_connections", "Open connections",
      static_cast<double>(load.connections));
  put(out, MetricType::Gauge, "ferrobench_rpc_waiting", "Calls that wait for a worker",
      static_cast<double>(load.calls_waiting));
  put(out, MetricType::Gauge, "ferrobench_subscribers", "Subscribers, by topic", subscribers);
  put(out, MetricType::Gauge, "ferrobench_notifications_queued", "Notifications that wait for their clients",
      static_cast<double>(counts.queued));
  put(out, MetricType::Counter, "ferrobench_notifications_dropped_total",
      "Notifications that slow clients missed; each was told how many by a gap",
      static_cast<double>(counts.dropped));
}

}  // namespace

struct Metrics::Counters {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& calls =
      prometheus::BuildCounter()
          .Name("ferrobench_rpc_calls_total")
          .Help("JSON-RPC calls by method and outcome: ok, or the error's name")
          .Register(registry);
  prometheus::Histogram& seconds = prometheus::BuildHistogram()
                                       .Name("ferrobench_rpc_seconds")
                                       .Help("How long a call took, from its turn to its result")
                                       .Register(registry)
                                       .Add({}, prometheus::Histogram::BucketBoundaries{
                                                    1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.1, 1, 10});
  prometheus::Family<prometheus::Counter>& refusals = prometheus::BuildCounter()
                                                          .Name("ferrobench_requests_refused_total")
                                                          .Help("Requests refused, by HTTP status")
                                                          .Register(registry);
};

Metrics::Metrics(Engine& engine) : engine_(engine), counters_(std::make_unique<Counters>()) {}

Metrics::~Metrics() = default;

void Metrics::call(const Call& call) {
  // A name that is no method's is anybody's invention, and may not make a new row.
  const std::string method = call.method == nullptr ? "unknown" : std::string(call.name);
  counters_->calls.Add({{"method", method}, {"outcome", std::string(call.outcome)}}).Increment();
  if (call.method != nullptr) counters_->seconds.Observe(std::chrono::duration<double>(call.time).count());
}

void Metrics::refusal(const Refusal& refusal) {
  counters_->refusals.Add({{"status", std::to_string(refusal.status)}}).Increment();
}

std::string Metrics::text(const Load& load, std::uint64_t audit_lines_lost) const {
  Families out;
  put(out, MetricType::Gauge, "ferrobench_info", "1, with the version",
      {{{{"version", std::string(recordings::software_version())},
         {"commit", std::string(recordings::software_commit())}},
        1}});
  put(out, MetricType::Gauge, "ferrobench_uptime_seconds", "Since the daemon's start", engine_.uptime());
  put_runs(out, engine_);
  put_clients(out, engine_.hub(), load);
  put(out, MetricType::Counter, "ferrobench_audit_lines_lost_total",
      "Lines of the audit log that could not be written: the disk was too slow, full, or failed",
      static_cast<double>(audit_lines_lost));
  std::error_code failure;
  if (const auto space = std::filesystem::space(engine_.store().folder(), failure); !failure)
    put(out, MetricType::Gauge, "ferrobench_data_free_bytes", "Room left on the disk of the data folder",
        static_cast<double>(space.available));
  for (auto& family : counters_->registry.Collect()) out.push_back(std::move(family));
  return prometheus::TextSerializer().Serialize(out);
}

}  // namespace ferrobench::server
