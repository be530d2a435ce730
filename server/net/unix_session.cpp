#include <sys/socket.h>

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "server/net/conversation.h"

namespace ferrobench::server {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using Socket = asio::local::stream_protocol::socket;

std::string refusal_line(int code, std::string_view message, const Refusal& refusal) {
  const nlohmann::json line{{"jsonrpc", "2.0"},
                            {"error", {{"code", code}, {"message", message}, {"data", refusal.body()}}},
                            {"id", nullptr}};
  return line.dump();
}

// Who is at the other end, as the kernel knows it.
std::string peer_of(int fd) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return "";
  return " user " + std::to_string(peer.uid) + " process " + std::to_string(peer.pid);
}

class UnixSession final : public Conversation {
 public:
  UnixSession(Service& service, Socket socket, const std::shared_ptr<CallContext>& context, bool only_stops)
      : Conversation(service, context),
        client_(context->client),
        socket_(std::move(socket)),
        only_stops_(only_stops) {}

  void start() { begin(); }
  bool local() const override { return true; }
  bool only_stops() const override { return only_stops_; }

 private:
  void drop() override { broken(); }

  std::shared_ptr<UnixSession> mine() { return std::static_pointer_cast<UnixSession>(shared_from_this()); }

  void refused(const Refusal& refusal) {
    if (service_.content.refused) service_.content.refused(client_, "", refusal);
  }

  void read() override {
    const auto limit = service_.options.max_body_bytes;
    asio::async_read_until(
        socket_, asio::dynamic_buffer(buffer_, limit), '\n',
        [self = mine(), limit](error_code ec, std::size_t length) {
          if (ec == asio::error::not_found) {
            const Refusal refusal{.status = 413,
                                  .code = ErrorCode::invalid_params,
                                  .message = "the line is too long",
                                  .hint = "at most " + std::to_string(limit) + " bytes",
                                  .headers = {}};
            self->refused(refusal);
            return self->farewell(refusal_line(-32700, "Parse error", refusal));
          }
          if (ec == asio::error::eof) return self->ended();
          if (ec) return self->broken();
          auto line = self->buffer_.substr(0, length - 1);
          self->buffer_.erase(0, length);
          if (line.find_first_not_of(" \t\r") == std::string::npos) return self->read();
          if (self->only_stops_ && self->service_.dispatcher.look(line).lane != Lane::urgent)
            return self->turn_away();
          self->received(std::move(line));
        });
  }

  void turn_away() {
    const auto refusal = full_house();
    refused(refusal);
    farewell(refusal_line(entry(refusal.code).rpc_code, refusal.message, refusal));
  }

  void write(const std::string& text) override {
    const std::array<asio::const_buffer, 2> parts{asio::buffer(text), asio::buffer("\n", 1)};
    asio::async_write(socket_, parts, [self = mine()](error_code ec, std::size_t) {
      if (ec) return self->broken();
      self->written();
    });
  }

  void hang_up(const std::string&, bool) override {
    error_code ignored;
    socket_.shutdown(Socket::shutdown_both, ignored);
    socket_.close(ignored);
  }

  std::string client_;
  Socket socket_;
  std::string buffer_;
  bool only_stops_;
};

}  // namespace

void start_unix(Service& service, Socket socket) {
  auto context = std::make_shared<CallContext>();
  context->client = "unix " + std::to_string(service.connections) + peer_of(socket.native_handle());
  const bool only_stops = !service.has_local_place();
  std::make_shared<UnixSession>(service, std::move(socket), context, only_stops)->start();
}

}  // namespace ferrobench::server
