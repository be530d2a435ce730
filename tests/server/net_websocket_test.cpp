// The WebSocket, seen by a client of Boost.Beast.
#include <gtest/gtest.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <thread>

#include "net_bench.h"

namespace ferrobench::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using nlohmann::json;

class Browser {
 public:
  explicit Browser(const Bench& bench, int receive_buffer = 0) : socket_(io_) {
    auto& tcp_socket = socket_.next_layer();
    tcp_socket.open(tcp::v4());
    if (receive_buffer > 0) tcp_socket.set_option(asio::socket_base::receive_buffer_size(receive_buffer));
    tcp_socket.connect({asio::ip::address_v4::loopback(), bench.port()});
    socket_.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
      request.set(beast::http::field::authorization, "Bearer " + Bench::token);
      request.set(beast::http::field::origin, "http://" + bench.host());
    }));
    socket_.handshake(bench.host(), "/rpc");
  }
  void say(const std::string& text) { socket_.write(asio::buffer(text)); }
  void say_binary(const std::string& text) {
    socket_.binary(true);
    say(text);
  }
  json hear() {
    beast::flat_buffer buffer;
    socket_.read(buffer);
    return json::parse(beast::buffers_to_string(buffer.data()));
  }
  // Reads until the daemon closes, and says with which code.
  int end() {
    beast::flat_buffer buffer;
    beast::error_code ec;
    while (!ec) {
      socket_.read(buffer, ec);
      buffer.clear();
    }
    return ec == websocket::error::closed ? socket_.reason().code : 0;
  }
  void leave() { socket_.close(websocket::close_code::normal); }

 private:
  asio::io_context io_;
  websocket::stream<tcp::socket> socket_;
};

const std::string subscribe = R"({"jsonrpc":"2.0","method":"subscribe","params":{"topic":"samples"},"id":1})";

TEST(NetWebSocket, SameMethodsAndNotifications) {
  Bench bench;
  Browser browser(bench);
  browser.say(R"({"jsonrpc":"2.0","method":"echo","params":{"value":7},"id":"a"})");
  EXPECT_EQ(browser.hear(), (json{{"jsonrpc", "2.0"}, {"result", 7}, {"id", "a"}}));
  browser.say(R"([{"jsonrpc":"2.0","method":"count","id":1},{"jsonrpc":"2.0","method":"count"}])");
  EXPECT_EQ(browser.hear(), json::parse(R"([{"jsonrpc":"2.0","result":1,"id":1}])"));
  browser.say("{");
  EXPECT_EQ(browser.hear()["error"]["code"], -32700);
  browser.say(subscribe);
  EXPECT_EQ(browser.hear()["result"]["subscribed"], true);
  bench.hub.publish("samples", {{"n", 1}});
  EXPECT_EQ(browser.hear(), json::parse(R"({"jsonrpc":"2.0","method":"samples","params":{"n":1}})"));
  browser.leave();
  EXPECT_TRUE(eventually([&] { return bench.gone == 1; }));
  EXPECT_FALSE(bench.hub.wanted("samples"));
}

TEST(NetWebSocket, RequestsAreAnsweredInOrder) {
  Bench bench;
  Browser browser(bench);
  browser.say(R"({"jsonrpc":"2.0","method":"sleep","params":{"seconds":0.1},"id":0})");
  for (int i = 1; i < 40; ++i)
    browser.say(R"({"jsonrpc":"2.0","method":"count","id":)" + std::to_string(i) + "}");
  for (int i = 0; i < 40; ++i) EXPECT_EQ(browser.hear()["id"], i);
}

TEST(NetWebSocket, SlowReaderIsToldWhatItMissed) {
  ServerOptions options;
  options.outbox = {.messages = 20, .bytes = 1u << 20, .lost_before_close = 1'000'000};
  Bench bench(options);
  Browser slow(bench, 4096);
  slow.say(subscribe);
  EXPECT_EQ(slow.hear()["result"]["subscribed"], true);
  constexpr int published = 1000;
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < published; ++i)
    bench.hub.publish("samples", {{"n", i}, {"pad", std::string(20'000, 'x')}});
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20))
      << "the publisher waited for the reader";
  int heard = 0, lost = 0, last = -1;
  while (last < published - 1) {
    const auto message = slow.hear();
    if (message["method"] == "gap") {
      EXPECT_EQ(message["params"]["topic"], "samples");
      lost += message["params"]["lost"].get<int>();
    } else {
      ++heard;
      EXPECT_EQ(message["params"]["n"], heard + lost - 1) << "what is missing was told";
      last = message["params"]["n"];
    }
  }
  EXPECT_GT(lost, 0);
  EXPECT_EQ(heard + lost, published);
}

TEST(NetWebSocket, ReaderThatNeverReadsIsClosed) {
  ServerOptions options;
  options.outbox = {.messages = 10, .bytes = 1u << 20, .lost_before_close = 200};
  Bench bench(options);
  Browser stuck(bench, 4096);
  stuck.say(subscribe);
  ASSERT_TRUE(eventually([&] { return bench.hub.wanted("samples"); }));
  int published = 0;
  for (; published < 5000 && bench.hub.wanted("samples"); ++published)
    bench.hub.publish("samples", std::string(50'000, 'x'));
  EXPECT_LT(published, 5000);
  EXPECT_TRUE(eventually([&] { return bench.gone == 1; }));
  EXPECT_EQ(http(bench, {}).status, 200);
}

TEST(NetWebSocket, LongAndBinaryMessagesEndIt) {
  ServerOptions options;
  options.max_body_bytes = 1000;
  Bench bench(options);
  Browser talker(bench);
  talker.say(std::string(1001, ' '));
  EXPECT_EQ(talker.end(), websocket::close_code::too_big);
  Browser binary(bench);
  binary.say_binary("{}");
  EXPECT_EQ(binary.end(), websocket::close_code::unknown_data);
  Browser deep(bench);
  deep.say(std::string(500, '['));
  EXPECT_EQ(deep.hear()["error"]["code"], -32700);
}

TEST(NetWebSocket, StopSaysGoodbye) {
  Bench bench;
  Browser browser(bench);
  browser.say(subscribe);
  browser.hear();
  std::thread stopper([&] { bench.server->stop(); });
  EXPECT_EQ(browser.end(), websocket::close_code::going_away);
  stopper.join();
}

TEST(NetWebSocket, SilentPeerIsClosed) {
  ServerOptions options;
  options.idle_timeout = std::chrono::milliseconds(200);
  Bench bench(options);
  const Browser silent(bench);  // answers no ping, since nobody reads
  EXPECT_TRUE(eventually([&] { return bench.gone == 1; }));
}

}  // namespace
}  // namespace ferrobench::server
