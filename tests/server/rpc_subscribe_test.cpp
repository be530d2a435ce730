// Topics, outboxes and what a slow client is told.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "server/rpc/discover.h"
#include "server/rpc/subscribe.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

std::vector<json> drain(Subscriber& subscriber) {
  std::vector<json> out;
  while (const auto text = subscriber.next()) out.push_back(json::parse(*text));
  return out;
}

Subscriber::Text text(const std::string& content) {
  return std::make_shared<const std::string>(content);
}

class RpcSubscribe : public testing::Test {
 protected:
  RpcSubscribe() {
    hub.add_topic({.name = "run", .doc = "state"});
    hub.add_topic({.name = "samples", .doc = "min and max", .merge = [](json& held, const json& next) {
                     held["max"] = std::max(held["max"].get<double>(), next["max"].get<double>());
                   }});
    add_subscription_methods(rpc, hub);
    caller.subscriber = subscriber;
  }
  json call(const std::string& method, const json& params) { return rpc.call(method, params, caller); }

  Hub hub;
  Dispatcher rpc;
  std::atomic<int> wakes{0};
  std::shared_ptr<Subscriber> subscriber = std::make_shared<Subscriber>(
      OutboxLimits{.messages = 3, .bytes = 1000, .lost_before_close = 20}, [this] { ++wakes; });
  CallContext caller;
};

TEST_F(RpcSubscribe, NotificationsAreJsonRpc) {
  EXPECT_FALSE(hub.wanted("run"));
  EXPECT_EQ(call("subscribe", {{"topic", "run"}}), (json{{"topic", "run"}, {"subscribed", true}}));
  EXPECT_TRUE(hub.wanted("run"));
  hub.publish("run", {{"state", "arming"}});
  hub.publish("samples", {{"max", 1}});
  EXPECT_EQ(
      drain(*subscriber),
      std::vector<json>{json::parse(R"({"jsonrpc":"2.0","method":"run","params":{"state":"arming"}})")});
  EXPECT_EQ(call("unsubscribe", {{"topic", "run"}}), (json{{"topic", "run"}, {"subscribed", false}}));
  hub.publish("run", {{"state", "running"}});
  EXPECT_TRUE(drain(*subscriber).empty());
}

TEST_F(RpcSubscribe, SubscribingTwiceSendsOnce) {
  call("subscribe", {{"topic", "run"}});
  call("subscribe", {{"topic", "run"}});
  hub.publish("run", {});
  EXPECT_EQ(drain(*subscriber).size(), 1u);
}

TEST_F(RpcSubscribe, RefusesWhatCannotBe) {
  const auto name_of = [&](const json& params) {
    try {
      call("subscribe", params);
    } catch (const Error& e) {
      return std::string(entry(e.code()).name) + ": " + e.problems().at(0).hint;
    }
    return std::string{};
  };
  EXPECT_EQ(name_of({{"topic", "sample"}}), "not_found: did you mean \"samples\"?");
  EXPECT_EQ(name_of({{"topic", "run"}, {"max_rate_Hz", 5}}), "invalid_params: leave it out");
  caller.subscriber = nullptr;
  EXPECT_TRUE(name_of({{"topic", "run"}}).starts_with("bad_state: open a WebSocket"));
}

TEST_F(RpcSubscribe, FullOutboxDropsTheOldestOfTheTopicAndTellsTheGap) {
  subscriber->offer("run", text(R"({"n":0})"));
  for (int i = 1; i <= 5; ++i) subscriber->offer("samples", text(json{{"n", i}}.dump()));
  subscriber->offer("run", text(R"({"n":6})"));
  const auto got = drain(*subscriber);
  ASSERT_EQ(got.size(), 5u);
  // The first "run" outlives the samples; the last one has to push out something of its own topic.
  EXPECT_EQ(got[0], json::parse(R"({"jsonrpc":"2.0","method":"gap","params":{"topic":"run","lost":1}})"));
  EXPECT_EQ(got[1], json::parse(R"({"jsonrpc":"2.0","method":"gap","params":{"topic":"samples","lost":3}})"));
  EXPECT_EQ(got[2]["n"], 4);
  EXPECT_EQ(got[3]["n"], 5);
  EXPECT_EQ(got[4]["n"], 6);
  EXPECT_TRUE(drain(*subscriber).empty()) << "a gap is told once";
}

TEST_F(RpcSubscribe, BytesAreBoundedToo) {
  subscriber->offer("run", text(std::string(600, ' ') + "1"));
  subscriber->offer("run", text(std::string(600, ' ') + "2"));
  auto got = drain(*subscriber);
  ASSERT_EQ(got.size(), 2u);
  EXPECT_EQ(got[0]["params"]["lost"], 1);
  EXPECT_EQ(got[1], 2);
  subscriber->offer("run", text(std::string(2000, ' ')));
  got = drain(*subscriber);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0]["params"]["lost"], 1);
}

TEST_F(RpcSubscribe, ClientThatTakesNothingIsGivenUp) {
  for (int i = 0; i < 23; ++i) subscriber->offer("run", text("1"));
  EXPECT_FALSE(subscriber->closed());
  subscriber->offer("run", text("1"));
  EXPECT_TRUE(subscriber->closed());
  EXPECT_EQ(subscriber->next(), nullptr);
  call("subscribe", {{"topic", "run"}});
  hub.publish("run", {});
  EXPECT_FALSE(hub.wanted("run"));
}

TEST_F(RpcSubscribe, TransportIsWokenOnceUntilItLooked) {
  subscriber->offer("run", text("1"));
  subscriber->offer("run", text("2"));
  EXPECT_EQ(wakes, 1);
  EXPECT_EQ(drain(*subscriber).size(), 2u);
  subscriber->offer("run", text("3"));
  EXPECT_EQ(wakes, 2);
  subscriber->close();
  subscriber->offer("run", text("4"));
  EXPECT_EQ(wakes, 2);
}

TEST_F(RpcSubscribe, RateMergesInsteadOfLosing) {
  call("subscribe", {{"topic", "samples"}, {"max_rate_Hz", 0.01}});
  hub.publish("samples", {{"max", 1}});
  hub.publish("samples", {{"max", 9}});
  hub.publish("samples", {{"max", 4}});
  auto got = drain(*subscriber);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0]["params"]["max"], 1);
  hub.flush("samples");
  got = drain(*subscriber);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0]["params"]["max"], 9);
  hub.flush("samples");
  EXPECT_TRUE(drain(*subscriber).empty());
}

TEST_F(RpcSubscribe, PublishersAndReadersInParallelLoseNothingUntold) {
  const auto own = std::make_shared<Subscriber>(
      OutboxLimits{.messages = 64, .bytes = 100'000, .lost_before_close = 1'000'000}, [] {});
  hub.subscribe("run", own, std::nullopt);
  constexpr int each = 2000;
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < each; ++i) hub.publish("run", {{"i", i}});
    });
  std::int64_t seen = 0, lost = 0;
  const auto take = [&] {
    for (const auto& m : drain(*own))
      (m["method"] == "gap" ? lost : seen) += m["method"] == "gap" ? m["params"]["lost"].get<int>() : 1;
  };
  while (seen + lost < 3 * each) take();
  for (auto& thread : threads) thread.join();
  take();
  EXPECT_EQ(seen + lost, 3 * each);
  EXPECT_GT(seen, 0);
}

TEST_F(RpcSubscribe, DiscoveryIsTheTable) {
  add_discovery(rpc, hub, "1.2.3");
  const auto document = call("rpc.discover", nullptr);
  EXPECT_EQ(document["openrpc"], "1.3.2");
  EXPECT_EQ(document["info"]["version"], "1.2.3");
  ASSERT_EQ(document["methods"].size(), rpc.methods().size());
  const auto& subscribe = *std::find_if(document["methods"].begin(), document["methods"].end(),
                                        [](const json& m) { return m["name"] == "subscribe"; });
  EXPECT_EQ(subscribe["x-role"], "view");
  EXPECT_EQ(subscribe["params"][0]["name"], "topic");
  EXPECT_EQ(subscribe["params"][0]["required"], true);
  EXPECT_EQ(subscribe["params"][1]["schema"]["x-unit"], "Hz");
  EXPECT_EQ(subscribe["result"]["schema"]["properties"]["subscribed"]["type"], "boolean");
  for (const auto& error : subscribe["errors"])
    EXPECT_TRUE(document.contains(json::json_pointer(error["$ref"].get<std::string>().substr(1))));
  EXPECT_EQ(document["components"]["errors"]["busy"]["code"], -32009);
  EXPECT_EQ(document["x-notifications"].size(), 2u);
}

}  // namespace
}  // namespace ferrobench::server
