#include "server/net/websocket_session.h"

#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <utility>

#include "server/net/conversation.h"

namespace ferrobench::server {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;
using beast::error_code;

template <class Stream>
class WebSocketSession final : public Conversation {
 public:
  WebSocketSession(Service& service, Stream stream, beast::http::request<beast::http::string_body> request,
                   std::shared_ptr<CallContext> context)
      : Conversation(service, std::move(context)), socket_(std::move(stream)), request_(std::move(request)) {
    trusted_ = true;
    beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has timeouts of its own
    websocket::stream_base::timeout timeouts{};
    timeouts.handshake_timeout = service.options.header_timeout;
    timeouts.idle_timeout = service.options.idle_timeout;
    timeouts.keep_alive_pings = true;
    socket_.set_option(timeouts);
    socket_.read_message_max(service.options.max_body_bytes);
    socket_.text(true);
  }

  void accept() {
    socket_.async_accept(request_, [self = mine()](error_code ec) {
      if (!ec) self->begin();
    });
  }

 private:
  std::shared_ptr<WebSocketSession> mine() {
    return std::static_pointer_cast<WebSocketSession>(shared_from_this());
  }

  void read() override {
    socket_.async_read(buffer_, [self = mine()](error_code ec, std::size_t) {
      if (ec) return self->broken();
      if (!self->socket_.got_text()) {
        self->code_ = websocket::close_code::unknown_data;
        return self->broken();
      }
      auto text = beast::buffers_to_string(self->buffer_.data());
      self->buffer_.clear();
      self->received(std::move(text));
    });
  }

  void write(const std::string& text) override {
    socket_.async_write(boost::asio::buffer(text), [self = mine()](error_code ec, std::size_t) {
      if (ec) return self->broken();
      self->written();
    });
  }

  void hang_up(const std::string& why, bool writing) override {
    // With a write under way the client does not read: there is no point in a polite goodbye.
    if (writing || !socket_.is_open()) return beast::get_lowest_layer(socket_).close();
    if (!why.empty()) code_ = websocket::close_code::policy_error;
    if (service_.stopping) code_ = websocket::close_code::going_away;
    socket_.async_close({code_, beast::string_view(why)}, [self = mine()](error_code) {});
  }

  websocket::stream<Stream> socket_;
  beast::flat_buffer buffer_;
  beast::http::request<beast::http::string_body> request_;
  websocket::close_code code_ = websocket::close_code::normal;
};

}  // namespace

void start_websocket(Service& service, PlainStream stream,
                     beast::http::request<beast::http::string_body> request,
                     std::shared_ptr<CallContext> context) {
  context->client.replace(0, std::string_view("http").size(), "websocket");
  std::make_shared<WebSocketSession<PlainStream>>(service, std::move(stream), std::move(request),
                                                  std::move(context))
      ->accept();
}

void start_websocket(Service& service, TlsStream stream,
                     beast::http::request<beast::http::string_body> request,
                     std::shared_ptr<CallContext> context) {
  context->client.replace(0, std::string_view("https").size(), "websocket with TLS");
  std::make_shared<WebSocketSession<TlsStream>>(service, std::move(stream), std::move(request),
                                                std::move(context))
      ->accept();
}

}  // namespace ferrobench::server
