// Topics and who listens to them. publish() is for any thread and never waits for a client.
//
// A subscriber may ask for at most so many messages a second of a topic that knows how to merge (samples:
// minimum and maximum over both); what comes in between is merged, not lost. Other topics are always sent in
// full.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/rpc/pace.h"
#include "server/rpc/subscriber.h"

namespace ferrobench::server {

struct Topic {
  std::string name;
  std::string doc;
  nlohmann::json schema = nlohmann::json::object();  // of the notification's params
  std::function<void(nlohmann::json& held, const nlohmann::json& next)> merge = nullptr;
};

struct HubCounts {
  std::map<std::string, std::size_t> subscribers;  // by topic
  std::size_t queued = 0;                          // messages, over all outboxes
  std::uint64_t dropped = 0;                       // ever
};

class Hub {
 public:
  void add_topic(Topic topic);  // before the first publish
  const std::map<std::string, Topic, std::less<>>& topics() const { return topics_; }

  // Sends {"jsonrpc": "2.0", "method": topic, "params": params} to whoever subscribed.
  void publish(std::string_view topic, const nlohmann::json& params);
  // Sends what merging still holds back, for example at the end of a run.
  void flush(std::string_view topic);
  // Whether anybody listens: saves making a message that nobody gets.
  bool wanted(std::string_view topic) const;
  HubCounts counts() const;

  // Again for the same topic: only the rate changes. Throws Error(not_found) for an unknown topic and
  // Error(invalid_params) for a rate on a topic that cannot merge.
  void subscribe(std::string_view topic, const std::shared_ptr<Subscriber>& subscriber,
                 std::optional<double> max_rate);
  bool unsubscribe(std::string_view topic, const Subscriber& subscriber);  // false: was not subscribed
  void remove(const Subscriber& subscriber);                               // from every topic

 private:
  struct Subscription {
    std::shared_ptr<Subscriber> subscriber;
    Pace pace;
    std::optional<nlohmann::json> held;
  };
  const Topic& find(std::string_view name) const;

  std::map<std::string, Topic, std::less<>> topics_;
  mutable std::mutex mutex_;
  std::uint64_t dropped_ = 0;
  std::map<std::string, std::vector<Subscription>, std::less<>> subscriptions_;
};

}  // namespace ferrobench::server
