// Where the daemon listens and how much it takes from a client.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "server/rpc/subscriber.h"

namespace ferrobench::server {

struct ServerOptions {
  std::string address = "127.0.0.1";     // numeric; anything but loopback needs TLS
  std::uint16_t port = 8377;             // 0: any free one
  std::string tls_certificate, tls_key;  // PEM files; "": no TLS
  std::vector<std::string>
      extra_hosts;              // names ("bench.lab") that others reach it by, beside the loopback ones
  std::string unix_socket;      // path; "" for none
  std::string token;            // 64 hexadecimal digits, from load_or_create_token()
  unsigned worker_threads = 4;  // calls under way at once; half of them serve what is heavy
  std::size_t max_connections =
      64;  // by TCP; who has not shown the token gives way. As many by the Unix socket
  std::size_t max_body_bytes = 4u << 20;
  std::size_t max_header_bytes = 16u << 10;
  std::chrono::milliseconds header_timeout{
      15'000};  // from connecting, or from the last reply, to the end of the head
  std::chrono::milliseconds body_timeout{30'000};
  std::chrono::milliseconds reply_timeout{30'000};  // to take a reply, or the next 256 KiB of a file
  std::chrono::milliseconds idle_timeout{60'000};   // a WebSocket that does not answer a ping
  std::chrono::milliseconds stop_timeout{2'000};    // for replies under way when the daemon stops
  OutboxLimits outbox;

  // Everything wrong with the options, none if they are fine.
  std::vector<Problem> validate() const;
  // What goes into a browser ("https://bench.lab:8377"): beyond loopback the first name that others reach it
  // by.
  std::string origin(std::uint16_t bound_port) const;
};

}  // namespace ferrobench::server
