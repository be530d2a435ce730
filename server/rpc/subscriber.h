// The outbox of one client for notifications: bounded, filled by any thread, emptied by the client's
// transport.
//
// When it is full the oldest message of the same topic goes (else the oldest of all), and the client is told
// how many it missed by a notification {"method": "gap", "params": {"topic": t, "lost": n}} ahead of what is
// left. A client that takes nothing while `lost_before_close` messages are lost is given up: closed() turns
// true.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace ferrobench::server {

struct OutboxLimits {
  std::size_t messages = 256;
  std::size_t bytes = 4u << 20;
  std::uint64_t lost_before_close = 10'000;
};

class Subscriber {
 public:
  using Text = std::shared_ptr<const std::string>;

  // `wake` tells the transport that next() has something, or that the subscriber closed. It runs on the
  // publisher's thread under a lock: it may only post to another thread.
  Subscriber(OutboxLimits limits, std::function<void()> wake);

  // How many messages had to go for it, or with it.
  std::uint64_t offer(const std::string& topic, Text text);
  std::size_t queued() const;
  // The next message to send, or null; after null, the next offer() wakes the transport again.
  Text next();
  // After this no message is taken and `wake` is never called again.
  void close();
  bool closed() const;

 private:
  struct Message {
    std::string topic;
    Text text;
  };
  void drop_for(const std::string& topic);
  void wake_once();

  const OutboxLimits limits_;
  mutable std::mutex mutex_;
  std::function<void()> wake_;
  std::deque<Message> queue_;
  std::map<std::string, std::uint64_t> lost_;  // by topic, not yet told
  std::uint64_t lost_since_taken_ = 0;
  std::size_t bytes_ = 0;
  bool asleep_ = true;
  bool closed_ = false;
};

}  // namespace ferrobench::server
