// One end of the connection between server and bench process: messages in and out of a socket that never
// blocks. Not for two threads at a time.
#pragma once

#include <deque>

#include "recordings/disk/durable_file.h"
#include "server/bench/messages.h"

namespace ferrobench::bench {

using recordings::Descriptor;

class Channel {
 public:
  // Has the socket not block.
  explicit Channel(Descriptor socket);

  int descriptor() const { return socket_.get(); }
  // Queues it, with an open file that the other side gets a descriptor of.
  void send(std::string frame, Descriptor file = {});
  std::size_t bytes_queued() const { return queued_; }
  // Both: false, the other side is gone.
  bool flush();    // sends what the socket takes now
  bool receive();  // takes what has come
  // Throws Damaged as Inbox.
  std::optional<Message> next() { return inbox_.next(); }
  // The oldest file that came and was not taken; empty if there is none.
  Descriptor take_file();

 private:
  struct Outgoing {
    std::string bytes;
    Descriptor file;
  };
  Descriptor socket_;
  std::deque<Outgoing> out_;
  std::size_t sent_ = 0, queued_ = 0;  // of the first; of all
  Inbox inbox_;
  std::deque<Descriptor> files_;
};

}  // namespace ferrobench::bench
