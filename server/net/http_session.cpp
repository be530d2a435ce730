#include <sys/stat.h>

#include <boost/asio/buffer.hpp>
#include <boost/beast/core/detect_ssl.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <filesystem>
#include <type_traits>
#include <utility>

#include "server/net/file_range.h"
#include "server/net/service.h"
#include "server/net/websocket_session.h"

namespace ferrobench::server {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using beast::error_code;
using http::field;

constexpr auto linger_timeout = std::chrono::seconds(1);
constexpr std::size_t linger_bytes = 1u << 20;

// Scripts, styles and connections from the daemon itself only; nobody may frame it.
constexpr auto page_policy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

// All values of a field; more than one are joined so that they match nothing.
std::string value_of(const http::fields& fields, field name) {
  std::string out;
  const auto [first, last] = fields.equal_range(name);
  for (auto it = first; it != last; ++it) out += (it == first ? "" : ", ") + std::string(it->value());
  return out;
}

// Whatever Beast would refuse by itself is refused with the others.
bool asks_for_websocket(const http::request_header<>& request) {
  return beast::websocket::is_upgrade(request) && value_of(request, field::sec_websocket_version) == "13" &&
         value_of(request, field::sec_websocket_key).size() == 24;
}

std::string address_of(const PlainStream& stream) {
  error_code gone;
  return stream.socket().remote_endpoint(gone).address().to_string();
}

// Stream: PlainStream or TlsStream.
template <class Stream>
class HttpSession final : public Session, public std::enable_shared_from_this<HttpSession<Stream>> {
 public:
  HttpSession(Service& service, Stream stream)
      : Session(service, address_of(beast::get_lowest_layer(stream))),
        stream_(std::move(stream)),
        context_(std::make_shared<CallContext>()) {
    error_code gone;
    context_->client = (is_tls ? "https " : "http ") + address() + " port " +
                       std::to_string(tcp().socket().remote_endpoint(gone).port());
  }

  void start() { read_head(); }

  // Somebody speaks plainly where TLS is asked for.
  void refuse_plain() {
    refuse({400,
            ErrorCode::unauthorized,
            "this port speaks TLS only",
            "use https:// (wss:// for a WebSocket) and trust the daemon's certificate",
            {}});
  }

  void stop() override {
    keep_open_ = false;
    if (idle_) tcp().cancel();
  }

 private:
  static constexpr bool is_tls = std::is_same_v<Stream, TlsStream>;
  using Request = http::request_parser<http::string_body>;

  void drop() override { tcp().close(); }

  auto self() { return this->shared_from_this(); }
  PlainStream& tcp() { return beast::get_lowest_layer(stream_); }

  void read_head() {
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(service_.options.max_header_bytes));
    parser_->body_limit(service_.options.max_body_bytes);
    idle_ = true;
    tcp().expires_after(service_.options.header_timeout);
    http::async_read_header(stream_, buffer_, *parser_, [self = self()](error_code ec, std::size_t) {
      self->idle_ = false;
      self->on_head(ec);
    });
  }

  // Whether reading went well; otherwise the client is told what it did wrong. One that takes too long is
  // closed without a word: it does not read either.
  bool received(error_code ec) {
    if (!ec) return true;
    if (ec == http::error::body_limit) {
      refuse({413,
              ErrorCode::invalid_params,
              "the request is too long",
              "at most " + std::to_string(service_.options.max_body_bytes) + " bytes",
              {}});
    } else if (ec == http::error::header_limit || ec == http::error::buffer_overflow) {
      refuse({431,
              ErrorCode::invalid_params,
              "the request's head is too long",
              "at most " + std::to_string(service_.options.max_header_bytes) + " bytes",
              {}});
    } else if (ec.category() == http::make_error_code(http::error::bad_method).category() &&
               ec != http::error::end_of_stream && ec != http::error::partial_message) {
      refuse({400,
              ErrorCode::invalid_params,
              "this is not HTTP: " + ec.message(),
              "use an HTTP/1.1 client",
              {}});
    }
    return false;
  }

  void on_head(error_code ec) {
    if (!received(ec)) return;
    const auto& request = parser_->get();
    const RequestHead head{.method = std::string(request.method_string()),
                           .target = std::string(request.target()),
                           .host = value_of(request, field::host),
                           .origin = request.count(field::origin) > 0
                                         ? std::optional(value_of(request, field::origin))
                                         : std::nullopt,
                           .authorization = value_of(request, field::authorization),
                           .cookie = value_of(request, field::cookie),
                           .content_type = value_of(request, field::content_type),
                           .upgrade = asks_for_websocket(request)};
    const auto decision = service_.admission->admit(head);
    if (const auto* refusal = std::get_if<Refusal>(&decision)) return refuse(*refusal);
    const auto& [route, path] = std::get<Admitted>(decision);
    trusted_ = trusted_ || service_.has_place();
    // In a full house whoever has shown the token still stops the bench, and gets the page to do so.
    if (!trusted_) {
      keep_open_ = false;
      if (route != Route::rpc_call && route != Route::page && route != Route::sign_in)
        return refuse(full_house());
    }
    context_->lease = std::string(request["Ferrobench-Lease"]);
    switch (route) {
      case Route::rpc_socket:
        if (buffer_.size() > 0)
          return refuse({400,
                         ErrorCode::invalid_params,
                         "the client spoke before the WebSocket was open",
                         "wait for the reply to the upgrade, then send frames",
                         {}});
        return start_websocket(service_, std::move(stream_), parser_->release(), context_);
      case Route::rpc_call:
        return read_body();
      case Route::recording:
        return send_recording(path);
      case Route::metrics:
        return send_metrics();
      case Route::page:
        return send_page(path);
      case Route::sign_in:
        return sign_in();
    }
  }

  void read_body() {
    tcp().expires_after(service_.options.body_timeout);
    auto me = self();
    if (beast::iequals(parser_->get()[field::expect], "100-continue")) {
      auto go_on = std::make_shared<http::response<http::empty_body>>(http::status::continue_, 11);
      return http::async_write(stream_, *go_on, [me, go_on](error_code ec, std::size_t) {
        if (!ec) me->read_rest();
      });
    }
    read_rest();
  }

  void read_rest() {
    http::async_read(stream_, buffer_, *parser_, [self = self()](error_code ec, std::size_t) {
      if (self->received(ec)) self->call();
    });
  }

  void call() {
    if (!trusted_ && service_.dispatcher.look(parser_->get().body()).lane != Lane::urgent)
      return refuse(full_house());
    tcp().expires_never();
    service_.call(std::move(parser_->get().body()), context_,
                  [self = self()](std::optional<std::string> reply) {
                    if (reply) {
                      self->send_text(http::status::ok, "application/json", std::move(*reply));
                    } else {
                      self->send_text(http::status::no_content, "", "");
                    }
                  });
  }

  void send_page(const std::string& path) {
    const auto asset = service_.content.asset ? service_.content.asset(path) : std::nullopt;
    if (!asset) return refuse_path();
    auto response = make<http::string_body>(http::status::ok);
    response.set(field::content_type,
                 beast::string_view(asset->content_type.data(), asset->content_type.size()));
    response.set("Content-Security-Policy", page_policy);
    response.set("X-Frame-Options", "DENY");
    response.body() = std::string(asset->content);
    send(std::move(response));
  }

  void refuse_path() {
    refuse({404,
            ErrorCode::not_found,
            "there is nothing at this path",
            "the page is at /, calls go to /rpc, recordings are under /recordings/",
            {}});
  }

  void send_metrics() {
    if (!service_.content.metrics) return refuse_path();
    tcp().expires_never();
    const Load load{service_.sessions.size(), service_.calls_waiting};
    service_.run(
        Lane::usual, [&metrics = service_.content.metrics, load] { return metrics(load); },
        [self = self()](std::optional<std::string> text) {
          self->send_text(http::status::ok, "text/plain; version=0.0.4; charset=utf-8", *std::move(text));
        });
  }

  // The token leaves the address bar for a session of its own: a cookie that no script can read and no other
  // site can send, and that is of no use for long.
  void sign_in() {
    auto response = make<http::string_body>(http::status::see_other);
    response.set(field::location, "/");
    response.set(field::set_cookie, service_.admission->sign_in());
    send(std::move(response));
  }

  void send_recording(const std::string& name) {
    if (name.empty() || name.find('/') != std::string::npos || !service_.content.recording)
      return send_file(std::nullopt);
    tcp().expires_never();
    auto file = std::make_shared<std::optional<FileRange>>();
    service_.at_the_disk(
        [&find = service_.content.recording, name, file] {
          if (const auto path = find(name)) *file = FileRange::open(*path);
        },
        [self = self(), file] { self->send_file(std::move(*file)); });
  }

  void send_file(std::optional<FileRange> file) {
    if (!file)
      return refuse(
          {404, ErrorCode::not_found, "there is no recording of this name", "recording.list names them", {}});
    const std::uint64_t whole = file->length;
    const auto wanted = parse_range(std::string(parser_->get()[field::range]), whole);
    if (wanted && wanted->length == 0)
      return refuse({416,
                     ErrorCode::invalid_params,
                     "the range is outside the file",
                     "the file has " + std::to_string(whole) + " bytes",
                     {{"Content-Range", "bytes */" + std::to_string(whole)}}});
    auto response = make<http::buffer_body>(wanted ? http::status::partial_content : http::status::ok);
    response.set(field::content_type, "application/x-hdf5");
    response.set(field::accept_ranges, "bytes");
    response.set(field::content_disposition, "attachment");
    if (wanted) {
      file->first = wanted->first;
      file->length = wanted->length;
      response.set(field::content_range, "bytes " + std::to_string(wanted->first) + "-" +
                                             std::to_string(wanted->first + wanted->length - 1) + "/" +
                                             std::to_string(whole));
    }
    response.body().more = true;
    response.content_length(file->length);
    keep_open_ = keep_open_ && !service_.stopping && parser_->get().keep_alive();
    response.keep_alive(keep_open_);
    auto sent = std::make_shared<Sent>(std::move(response), *std::move(file));
    tcp().expires_after(service_.options.reply_timeout);
    http::async_write_header(stream_, sent->serializer, [self = self(), sent](error_code ec, std::size_t) {
      if (!ec) self->send_next(sent);
    });
  }

  // A reply whose body is read and sent in turn.
  struct Sent {
    Sent(http::response<http::buffer_body> r, FileRange f)
        : response(std::move(r)), serializer(response), file(std::move(f)) {}
    http::response<http::buffer_body> response;
    http::response_serializer<http::buffer_body> serializer;
    FileRange file;
    std::string portion;
  };

  // A client that takes a portion in no less than reply_timeout is given up.
  void send_next(const std::shared_ptr<Sent>& sent) {
    constexpr std::size_t portion = 256u << 10;
    if (sent->file.length == 0) return replied();
    tcp().expires_never();
    service_.at_the_disk([sent] { sent->portion = sent->file.take(portion); },
                         [self = self(), sent] {
                           if (sent->portion.empty()) return;  // the client sees a short reply
                           auto& body = sent->response.body();
                           body.data = sent->portion.data();
                           body.size = sent->portion.size();
                           body.more = sent->file.length > 0;
                           self->tcp().expires_after(self->service_.options.reply_timeout);
                           http::async_write(self->stream_, sent->serializer,
                                             [self, sent](error_code ec, std::size_t) {
                                               if (!ec || ec == http::error::need_buffer)
                                                 self->send_next(sent);
                                             });
                         });
  }

  void refuse(const Refusal& refusal) {
    if (service_.content.refused) {
      std::string request;
      if (parser_) {
        const auto target = parser_->get().target();
        request = std::string(parser_->get().method_string()) + " " +
                  std::string(target.substr(0, target.find('?')));
      }
      service_.content.refused(context_->client, request, refusal);
    }
    auto response = make<http::string_body>(static_cast<http::status>(refusal.status));
    response.set(field::content_type, "application/json");
    for (const auto& [name, value] : refusal.headers) response.set(name, value);
    response.body() = refusal.body().dump() + "\n";
    keep_open_ = false;  // what else the request brings is not read
    send(std::move(response));
  }

  void send_text(http::status status, const char* content_type, std::string&& body) {
    auto response = make<http::string_body>(status);
    if (*content_type != 0) response.set(field::content_type, content_type);
    response.body() = std::move(body);
    send(std::move(response));
  }

  template <class Body>
  http::response<Body> make(http::status status) {
    http::response<Body> response(status, 11);
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.set(field::cache_control, "no-store");
    response.set("Referrer-Policy", "no-referrer");
    return response;
  }

  template <class Body>
  void send(http::response<Body> response) {
    keep_open_ = keep_open_ && !service_.stopping && parser_ && parser_->get().keep_alive();
    response.keep_alive(keep_open_);
    response.prepare_payload();
    auto message = std::make_shared<http::response<Body>>(std::move(response));
    tcp().expires_after(service_.options.reply_timeout);
    http::async_write(stream_, *message, [self = self(), message](error_code ec, std::size_t) {
      if (!ec) self->replied();
    });
  }

  void replied() {
    if (keep_open_) return read_head();
    linger();
  }

  void linger() {
    tcp().expires_after(linger_timeout);
    if constexpr (is_tls) {
      stream_.async_shutdown([self = self()](error_code) { self->half_close(); });
    } else {
      half_close();
    }
  }

  // Closing with unread bytes would cost the client the reply: take what still comes, for a moment.
  void half_close() {
    error_code ignored;
    tcp().socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
    drain(0);
  }

  void drain(std::size_t seen) {
    buffer_.clear();
    tcp().async_read_some(buffer_.prepare(16u << 10), [self = self(), seen](error_code ec, std::size_t n) {
      if (!ec && seen + n < linger_bytes && !self->service_.stopping) self->drain(seen + n);
    });
  }

  Stream stream_;
  beast::flat_buffer buffer_;
  std::optional<Request> parser_;
  std::shared_ptr<CallContext> context_;
  bool keep_open_ = true;
  bool idle_ = false;  // waits for a request
};

// A connection to the port that speaks TLS, until it does.
class Greeting final : public Session, public std::enable_shared_from_this<Greeting> {
 public:
  Greeting(Service& service, PlainStream stream)
      : Session(service, address_of(stream)), stream_(std::move(stream)) {}

  void start() {
    stream_.expires_after(service_.options.header_timeout);
    beast::async_detect_ssl(stream_, buffer_, [self = shared_from_this()](error_code ec, bool tls) {
      if (ec) return;
      if (tls) return self->shake_hands();
      std::make_shared<HttpSession<PlainStream>>(self->service_, std::move(self->stream_))->refuse_plain();
    });
  }
  void stop() override { tcp().cancel(); }

 private:
  void drop() override { tcp().close(); }
  PlainStream& tcp() { return tls_ ? tls_->next_layer() : stream_; }

  void shake_hands() {
    tls_.emplace(std::move(stream_), *service_.tls);
    tls_->async_handshake(
        boost::asio::ssl::stream_base::server, buffer_.data(),
        [self = shared_from_this()](error_code ec, std::size_t) {
          if (ec) return;
          std::make_shared<HttpSession<TlsStream>>(self->service_, std::move(*self->tls_))->start();
        });
  }

  PlainStream stream_;
  beast::flat_buffer buffer_;
  std::optional<TlsStream> tls_;
};

}  // namespace

void start_http(Service& service, boost::asio::ip::tcp::socket socket) {
  if (service.tls) {
    std::make_shared<Greeting>(service, PlainStream(std::move(socket)))->start();
  } else {
    std::make_shared<HttpSession<PlainStream>>(service, PlainStream(std::move(socket)))->start();
  }
}

}  // namespace ferrobench::server
