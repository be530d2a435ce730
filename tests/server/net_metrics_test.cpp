// GET /metrics, read as Prometheus reads it: text exposition format 0.0.4.
#include <gtest/gtest.h>

#include <cmath>
#include <regex>
#include <set>
#include <sstream>

#include "engine_bench.h"
#include "net_bench.h"
#include "server/methods/methods.h"
#include "server/methods/metrics.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

struct Exposition {
  std::map<std::string, std::string> types, help;  // by family
  std::map<std::string, double> samples;           // by name and labels, as they stand

  double at(const std::string& sample) const {
    const auto found = samples.find(sample);
    EXPECT_NE(found, samples.end()) << sample;
    return found == samples.end() ? NAN : found->second;
  }
};

// Fails where the text breaks the format: a sample without HELP and TYPE before it, a family in two places, a
// name or label that may not be, a value that is no number, the same sample twice.
Exposition parse(const std::string& text) {
  static const std::regex sample(
      R"re(([a-zA-Z_:][a-zA-Z0-9_:]*)(\{([a-zA-Z_][a-zA-Z0-9_]*="([^"\\\n]|\\["\\n])*",?)*\})? (\S+))re");
  Exposition out;
  std::string family;
  EXPECT_TRUE(text.ends_with("\n"));
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    SCOPED_TRACE(line);
    std::istringstream words(line);
    std::string hash, keyword, name, rest;
    if (line.starts_with("# ")) {
      words >> hash >> keyword >> name;
      std::getline(words >> std::ws, rest);
      if (keyword == "HELP") {
        EXPECT_TRUE(out.help.emplace(name, rest).second) << "a family twice";
        EXPECT_FALSE(rest.empty());
        family = name;
      } else {
        EXPECT_EQ(keyword, "TYPE");
        EXPECT_EQ(name, family) << "TYPE comes after HELP";
        EXPECT_TRUE(out.types.emplace(name, rest).second);
        EXPECT_TRUE(rest == "counter" || rest == "gauge" || rest == "histogram");
      }
      continue;
    }
    std::smatch parts;
    if (!std::regex_match(line, parts, sample)) {
      ADD_FAILURE() << "this is no sample";
      continue;
    }
    auto of = parts[1].str();
    if (out.types[family] == "histogram")
      for (const std::string suffix : {"_bucket", "_sum", "_count"})
        if (of == family + suffix) of = family;
    EXPECT_EQ(of, family) << "a sample outside its family";
    EXPECT_TRUE(out.types.contains(family));
    char* end = nullptr;
    const auto number = parts[5].str();
    const double value = std::strtod(number.c_str(), &end);
    EXPECT_EQ(*end, 0);
    EXPECT_TRUE(out.samples.emplace(parts[1].str() + parts[2].str(), value).second) << "a sample twice";
    if (out.types[family] == "counter") {
      EXPECT_TRUE(family.ends_with("_total"));
      EXPECT_GE(value, 0);
    }
  }
  return out;
}

class MetricsTest : public EngineTest {
 protected:
  MetricsTest() {
    add_all_methods(rpc, engine);
    rpc.set_observer([this](const Call& call) { metrics.call(call); });
    ServerOptions options;
    options.port = 0;
    options.token = Bench::token;
    options.unix_socket = folder.path / "rpc.sock";
    Content content;
    content.refused = [this](std::string_view, std::string_view, const Refusal& r) { metrics.refusal(r); };
    content.metrics = [this](const Load& load) { return metrics.text(load, 0); };
    server.emplace(rpc, hub, options, std::move(content));
  }
  ~MetricsTest() override { server.reset(); }

  Reply get(const std::string& headers = "Authorization: Bearer " + Bench::token + "\r\n") const {
    return parse_reply(raw_exchange(
        server->port(), "GET /metrics HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(server->port()) +
                            "\r\nConnection: close\r\n" + headers + "\r\n"));
  }
  Exposition scrape() const { return parse(get().body); }

  Dispatcher rpc;
  Metrics metrics{engine};
  std::optional<Server> server;
};

TEST_F(MetricsTest, AskForTheTokenLikeEverything) {
  EXPECT_EQ(get("").status, 401);
  EXPECT_EQ(get("Authorization: Bearer x\r\n").status, 401);
  EXPECT_EQ(get("Authorization: Bearer " + Bench::token + "\r\nOrigin: http://evil.example\r\n").status, 403);
  auto reply = get();
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(reply.headers["Content-Type"], "text/plain; version=0.0.4; charset=utf-8");
  const auto said = parse(reply.body);
  EXPECT_EQ(said.at(R"(ferrobench_requests_refused_total{status="401"})"), 2);
  EXPECT_EQ(said.at(R"(ferrobench_requests_refused_total{status="403"})"), 1);
}

TEST_F(MetricsTest, SayWhatTheBenchDid) {
  const auto before = scrape();
  EXPECT_EQ(before.at(R"(ferrobench_run_state{state="idle"})"), 1);
  EXPECT_EQ(before.at("ferrobench_rows_acquired_total"), 0);

  auto client = Client::connect(folder.path / "rpc.sock");
  client.call("subscribe", {{"topic", "run"}});
  client.call("subscribe", {{"topic", "job"}});
  EXPECT_THROW(client.call("run.start", {{"protocol", "no-such-protocol"}}), Error);
  EXPECT_THROW(client.call("no.such.method"), Error);
  EXPECT_THROW(client.call("\"evil\"\n{} 1"), Error);
  const auto run = finish(request(trapezium(0.1, 0.2), true));
  auto aborted = engine.start(request(trapezium(1, 600), false));
  const auto during = scrape();
  engine.abort(aborted.run, "test");
  aborted = engine.wait(aborted.run);
  const auto after = scrape();

  EXPECT_EQ(during.at("ferrobench_output_at_zero"), 0);
  EXPECT_EQ(after.at("ferrobench_output_at_zero"), 1);
  EXPECT_EQ(after.at(R"(ferrobench_runs_total{outcome="complete"})"), 1);
  EXPECT_EQ(after.at(R"(ferrobench_runs_total{outcome="aborted"})"), 1);
  EXPECT_EQ(after.at(R"(ferrobench_run_state{state="aborted"})"), 1);
  EXPECT_EQ(after.at(R"(ferrobench_run_state{state="running"})"), 0);
  EXPECT_EQ(after.at("ferrobench_rows_acquired_total"), static_cast<double>(run.rows + aborted.rows));
  EXPECT_EQ(after.at("ferrobench_rows_on_disk_total"),
            static_cast<double>(run.rows_on_disk + aborted.rows_on_disk));
  EXPECT_EQ(after.at(R"(ferrobench_subscribers{topic="run"})"), 1);
  EXPECT_EQ(after.at(R"(ferrobench_subscribers{topic="samples"})"), 0);
  EXPECT_EQ(after.at(R"(ferrobench_rpc_calls_total{method="subscribe",outcome="ok"})"), 2);
  EXPECT_EQ(after.at(R"(ferrobench_rpc_calls_total{method="run.start",outcome="not_found"})"), 1);
  EXPECT_EQ(after.at(R"(ferrobench_rpc_calls_total{method="unknown",outcome="method_not_found"})"), 2);
  EXPECT_EQ(after.at("ferrobench_connections"), 2);  // the client, and the one that asks
  EXPECT_EQ(after.at("ferrobench_rpc_waiting"), 0);
  EXPECT_EQ(after.at("ferrobench_acquisition_queue_blocks"), 0);
  EXPECT_EQ(after.at("ferrobench_notifications_dropped_total"), 0);
  EXPECT_EQ(after.at("ferrobench_audit_lines_lost_total"), 0);
  EXPECT_GT(after.at("ferrobench_data_free_bytes"), 0);
  EXPECT_GE(after.at("ferrobench_uptime_seconds"), before.at("ferrobench_uptime_seconds"));

  EXPECT_EQ(after.at("ferrobench_rpc_seconds_count"), 3);
  EXPECT_EQ(after.at(R"(ferrobench_rpc_seconds_bucket{le="+Inf"})"), 3);
  EXPECT_GT(after.at("ferrobench_rpc_seconds_sum"), 0);
  std::map<double, double> buckets;
  for (const auto& [name, value] : after.samples)
    if (const auto le = name.find("le=\""); le != std::string::npos)
      buckets[std::strtod(&name[le + 4], nullptr)] = value;
  EXPECT_EQ(buckets.size(), 11u);
  double least = 0;
  for (const auto& [bound, count] : buckets)
    EXPECT_GE(count, std::exchange(least, count)) << "up to " << bound;

  for (const auto& [name, value] : before.samples)
    if (name.find("_total") != std::string::npos) {
      EXPECT_GE(after.at(name), value) << name << " went back";
    }
}

TEST_F(MetricsTest, CountWhatSlowClientsMissed) {
  const auto slow = std::make_shared<Subscriber>(OutboxLimits{.messages = 4}, nullptr);
  hub.subscribe("run", slow, std::nullopt);
  for (int i = 0; i < 10; ++i) hub.publish("run", {{"i", i}});
  const auto said = scrape();
  EXPECT_EQ(said.at("ferrobench_notifications_queued"), 4);
  EXPECT_EQ(said.at("ferrobench_notifications_dropped_total"), 6);
}

}  // namespace
}  // namespace ferrobench::server
