#include "server/rpc/subscriber.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

namespace ferrobench::server {

Subscriber::Subscriber(OutboxLimits limits, std::function<void()> wake)
    : limits_(limits), wake_(std::move(wake)) {}

void Subscriber::wake_once() {
  if (std::exchange(asleep_, false) && wake_) wake_();
}

void Subscriber::drop_for(const std::string& topic) {
  auto victim =
      std::find_if(queue_.begin(), queue_.end(), [&](const Message& m) { return m.topic == topic; });
  if (victim == queue_.end()) victim = queue_.begin();
  ++lost_[victim->topic];
  ++lost_since_taken_;
  bytes_ -= victim->text->size();
  queue_.erase(victim);
}

std::uint64_t Subscriber::offer(const std::string& topic, Text text) {
  const std::scoped_lock lock(mutex_);
  if (closed_) return 0;
  const auto before = lost_since_taken_;
  while (!queue_.empty() && (queue_.size() >= limits_.messages || bytes_ + text->size() > limits_.bytes))
    drop_for(topic);
  if (text->size() > limits_.bytes) {
    ++lost_[topic];
    ++lost_since_taken_;
  } else {
    bytes_ += text->size();
    queue_.push_back({topic, std::move(text)});
  }
  if (lost_since_taken_ > limits_.lost_before_close) {
    closed_ = true;
    asleep_ = true;
    queue_.clear();
  }
  wake_once();
  return lost_since_taken_ - before;
}

std::size_t Subscriber::queued() const {
  const std::scoped_lock lock(mutex_);
  return queue_.size();
}

Subscriber::Text Subscriber::next() {
  const std::scoped_lock lock(mutex_);
  if (closed_) return nullptr;
  if (!lost_.empty()) {
    const auto gap = lost_.extract(lost_.begin());
    const nlohmann::json notice{
        {"jsonrpc", "2.0"}, {"method", "gap"}, {"params", {{"topic", gap.key()}, {"lost", gap.mapped()}}}};
    return std::make_shared<const std::string>(notice.dump());
  }
  if (queue_.empty()) {
    asleep_ = true;
    return nullptr;
  }
  lost_since_taken_ = 0;
  auto text = std::move(queue_.front().text);
  queue_.pop_front();
  bytes_ -= text->size();
  return text;
}

void Subscriber::close() {
  const std::scoped_lock lock(mutex_);
  closed_ = true;
  wake_ = nullptr;
  queue_.clear();
  lost_.clear();
}

bool Subscriber::closed() const {
  const std::scoped_lock lock(mutex_);
  return closed_;
}

}  // namespace ferrobench::server
