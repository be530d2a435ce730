#include "server/rpc/hub.h"

#include <algorithm>
#include <cassert>
#include <set>
#include <utility>

#include "base/fields.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

Subscriber::Text notification(const std::string& topic, const json& params) {
  const json message{{"jsonrpc", "2.0"}, {"method", topic}, {"params", params}};
  return std::make_shared<const std::string>(message.dump(-1, ' ', false, json::error_handler_t::replace));
}

}  // namespace

void Hub::add_topic(Topic topic) {
  auto name = topic.name;
  topics_.emplace(std::move(name), std::move(topic));
}

const Topic& Hub::find(std::string_view name) const {
  const auto found = topics_.find(name);
  if (found != topics_.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [known, topic] : topics_) names.push_back(known);
  const auto guess = nearest_name(name.substr(0, 64), names);
  throw Error(ErrorCode::not_found, "there is no such topic",
              Problem{.path = "/topic",
                      .message = "is not a topic",
                      .given = name.substr(0, 64),
                      .allowed = names,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

void Hub::publish(std::string_view topic, const json& params) {
  const auto known = topics_.find(topic);
  assert(known != topics_.end());
  const std::scoped_lock lock(mutex_);
  const auto found = subscriptions_.find(topic);
  if (found == subscriptions_.end()) return;
  std::erase_if(found->second, [](const Subscription& s) { return s.subscriber->closed(); });
  Subscriber::Text whole;  // one text for all who get every message
  const auto now = Pace::Clock::now();
  for (auto& s : found->second) {
    if (s.pace.everything()) {
      if (!whole) whole = notification(known->first, params);
      dropped_ += s.subscriber->offer(known->first, whole);
      continue;
    }
    if (s.held) {
      known->second.merge(*s.held, params);
    } else {
      s.held = params;
    }
    if (!s.pace.passes(now)) continue;
    dropped_ +=
        s.subscriber->offer(known->first, notification(known->first, *std::exchange(s.held, std::nullopt)));
  }
}

void Hub::flush(std::string_view topic) {
  const std::scoped_lock lock(mutex_);
  const auto found = subscriptions_.find(topic);
  if (found == subscriptions_.end()) return;
  for (auto& s : found->second)
    if (s.held)
      dropped_ +=
          s.subscriber->offer(found->first, notification(found->first, *std::exchange(s.held, std::nullopt)));
}

bool Hub::wanted(std::string_view topic) const {
  const std::scoped_lock lock(mutex_);
  const auto found = subscriptions_.find(topic);
  return found != subscriptions_.end() && !found->second.empty();
}

HubCounts Hub::counts() const {
  const std::scoped_lock lock(mutex_);
  HubCounts out;
  std::set<const Subscriber*> boxes;
  for (const auto& [name, topic] : topics_) out.subscribers[name] = 0;
  for (const auto& [name, list] : subscriptions_)
    for (const auto& s : list) {
      ++out.subscribers[name];
      if (boxes.insert(s.subscriber.get()).second) out.queued += s.subscriber->queued();
    }
  out.dropped = dropped_;
  return out;
}

void Hub::subscribe(std::string_view topic, const std::shared_ptr<Subscriber>& subscriber,
                    std::optional<double> max_rate) {
  const Topic& known = find(topic);
  if (max_rate && !known.merge)
    throw Error(ErrorCode::invalid_params, "Invalid params",
                Problem{.path = "/max_rate_Hz",
                        .message = "this topic is always sent in full",
                        .given = *max_rate,
                        .hint = "leave it out"});
  Pace pace;
  if (max_rate)
    pace =
        Pace(std::chrono::duration_cast<Pace::Clock::duration>(std::chrono::duration<double>(1 / *max_rate)));
  const std::scoped_lock lock(mutex_);
  auto& list = subscriptions_[known.name];
  const auto mine =
      std::find_if(list.begin(), list.end(), [&](const auto& s) { return s.subscriber == subscriber; });
  if (mine != list.end()) {
    mine->pace = pace;
  } else {
    list.push_back({subscriber, pace, std::nullopt});
  }
}

bool Hub::unsubscribe(std::string_view topic, const Subscriber& subscriber) {
  find(topic);
  const std::scoped_lock lock(mutex_);
  const auto found = subscriptions_.find(topic);
  return found != subscriptions_.end() && std::erase_if(found->second, [&](const Subscription& s) {
                                            return s.subscriber.get() == &subscriber;
                                          }) > 0;
}

void Hub::remove(const Subscriber& subscriber) {
  const std::scoped_lock lock(mutex_);
  for (auto& [topic, list] : subscriptions_)
    std::erase_if(list, [&](const Subscription& s) { return s.subscriber.get() == &subscriber; });
}

}  // namespace ferrobench::server
