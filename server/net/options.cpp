#include "server/net/options.h"

#include <arpa/inet.h>

namespace ferrobench::server {
namespace {

enum class Reach { invalid, loopback, remote };

Reach reach_of(const std::string& address) {
  in_addr v4{};
  if (inet_pton(AF_INET, address.c_str(), &v4) == 1)
    return (ntohl(v4.s_addr) >> 24) == 127 ? Reach::loopback : Reach::remote;
  in6_addr v6{};
  if (inet_pton(AF_INET6, address.c_str(), &v6) == 1)
    return IN6_IS_ADDR_LOOPBACK(&v6) ? Reach::loopback : Reach::remote;
  return Reach::invalid;
}

}  // namespace

std::vector<Problem> ServerOptions::validate() const {
  std::vector<Problem> problems;
  const auto reach = reach_of(address);
  if (reach == Reach::invalid)
    problems.push_back({.path = "/address",
                        .message = "is not a numeric address",
                        .given = address,
                        .hint = "for example 127.0.0.1"});
  if (reach == Reach::remote && tls_certificate.empty())
    problems.push_back({.path = "/address",
                        .message = "would carry the token over the network for everybody to read",
                        .given = address,
                        .allowed = {"127.0.0.1", "::1"},
                        .hint = "name a certificate and its key (--tls-certificate, --tls-key), or listen at "
                                "127.0.0.1 and come by a tunnel: ssh -L 8377:127.0.0.1:8377 HOST"});
  if (tls_certificate.empty() != tls_key.empty())
    problems.push_back({.path = tls_key.empty() ? "/tls_key" : "/tls_certificate",
                        .message = "is missing",
                        .hint = "a certificate and its key come together"});
  if (token.size() < 32)
    problems.push_back({.path = "/token",
                        .message = "is too short to be a secret",
                        .given = token.size(),
                        .allowed = "at least 32 characters"});
  if (worker_threads == 0 || worker_threads > 256)
    problems.push_back({.path = "/worker_threads",
                        .message = "is outside its range",
                        .given = worker_threads,
                        .allowed = {{"from", 1}, {"to", 256}}});
  if (max_connections == 0)
    problems.push_back({.path = "/max_connections", .message = "must be at least 1", .given = 0});
  return problems;
}

std::string ServerOptions::origin(std::uint16_t bound_port) const {
  auto host = address;
  if (reach_of(address) == Reach::remote && !extra_hosts.empty())
    host = extra_hosts.front();
  else if (address == "0.0.0.0")  // every address there is, which nobody can open
    host = "127.0.0.1";
  else if (address == "::")
    host = "::1";
  if (host.find(':') != std::string::npos) host = "[" + host + "]";
  return (tls_certificate.empty() ? "http://" : "https://") + host + ":" + std::to_string(bound_port);
}

}  // namespace ferrobench::server
