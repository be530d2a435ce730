// Who is calling. One context lives as long as the connection it stands for; calls on one connection never
// overlap.
#pragma once

#include <memory>
#include <string>

namespace ferrobench::server {

class Subscriber;

// What a method does: looks, or changes something (and then needs the lease if somebody holds one), or makes
// the bench safe, which nobody is ever refused.
enum class Role { view, control, stop };

// Who serves a method: a thread that does nothing else, one of those for what is quick, or one of those for
// what reads recordings and takes its time. So viewers, however many, keep nobody from stopping the bench.
enum class Lane { urgent, usual, heavy };

struct CallContext {
  // "http 127.0.0.1 port 40112", "unix 7 user 1000 process 4711": for the logs, and to name a lease's holder
  std::string client;
  std::string lease;  // the lease this client presented or acquired, "" for none
  // This call was carried out already, ahead of its turn: a stop that overtook what was asked before it.
  bool again = false;
  // More views wait for a thread than anybody has the patience for: a heavy method is refused.
  bool crowded = false;
  std::shared_ptr<Subscriber> subscriber;  // null where notifications cannot be sent (HTTP POST)
};

}  // namespace ferrobench::server
