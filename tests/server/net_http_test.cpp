// The door over HTTP: replies, files, time-outs, limits. Who is refused stands in net_refusals_test.cpp.
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <thread>

#include "net_bench.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

const std::string bearer = "Authorization: Bearer " + Bench::token + "\r\n";
const std::string as_json = "Content-Type: application/json\r\n";
TEST(NetHttp, SaysWhatIsAllowed) {
  Bench bench;
  EXPECT_EQ(http(bench, {.method = "PUT"}).headers["Allow"], "GET, POST");
  EXPECT_EQ(http(bench, {.headers = as_json}).headers["WWW-Authenticate"], "Bearer");
}

TEST(NetHttp, NotificationHasNoContent) {
  Bench bench;
  const auto reply = http(bench, {.body = R"({"jsonrpc":"2.0","method":"count"})"});
  EXPECT_EQ(reply.status, 204);
  EXPECT_EQ(reply.body, "");
  EXPECT_EQ(bench.counted, 1);
}

TEST(NetHttp, JsonRpcErrorsAreRepliesNotRefusals) {
  Bench bench;
  const auto broken = http(bench, {.body = "{"});
  EXPECT_EQ(broken.status, 200);
  EXPECT_EQ(json::parse(broken.body)["error"]["code"], -32700);
  const auto deep = http(bench, {.body = std::string(100'000, '[')});
  EXPECT_EQ(json::parse(deep.body)["error"]["code"], -32700);
  const auto subscribe =
      http(bench, {.body = R"({"jsonrpc":"2.0","method":"subscribe","params":{"topic":"run"},"id":1})"});
  EXPECT_EQ(json::parse(subscribe.body)["error"]["data"]["name"], "bad_state");
}

TEST(NetHttp, LeaseTravelsInAHeader) {
  Bench bench;
  const auto reply = http(bench, {.headers = bearer + as_json + "Ferrobench-Lease: L7\r\n",
                                  .body = R"({"jsonrpc":"2.0","method":"who","id":1})"});
  EXPECT_EQ(json::parse(reply.body)["result"][1], "L7");
}

TEST(NetHttp, KeepsTheConnection) {
  Bench bench;
  const std::string body = R"({"jsonrpc":"2.0","method":"count","id":1})";
  const std::string head = "POST /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\n" + bearer + as_json +
                           "Content-Length: " + std::to_string(body.size()) + "\r\n";
  const auto text =
      raw_exchange(bench.port(), head + "\r\n" + body + head + "Connection: close\r\n\r\n" + body);
  EXPECT_NE(text.find(R"("result":1)"), std::string::npos);
  EXPECT_NE(text.find(R"("result":2)"), std::string::npos);
}

TEST(NetHttp, AnswersExpectContinue) {
  Bench bench;
  const std::string body = R"({"jsonrpc":"2.0","method":"count","id":1})";
  const auto text =
      raw_exchange(bench.port(), "POST /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\n" + bearer + as_json +
                                     "Expect: 100-continue\r\nConnection: close\r\nContent-Length: " +
                                     std::to_string(body.size()) + "\r\n\r\n" + body);
  EXPECT_TRUE(text.starts_with("HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 200 OK\r\n")) << text;
}

TEST(NetHttp, PageComesWithStrictHeaders) {
  Bench bench;
  auto reply = http(bench, {.method = "GET", .target = "/", .headers = bearer, .body = ""});
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(reply.body, "<!doctype html><title>bench</title>");
  EXPECT_EQ(reply.headers["Content-Type"], "text/html; charset=utf-8");
  EXPECT_EQ(reply.headers["X-Content-Type-Options"], "nosniff");
  EXPECT_EQ(reply.headers["Referrer-Policy"], "no-referrer");
  const auto policy = reply.headers["Content-Security-Policy"];
  EXPECT_NE(policy.find("default-src 'none'"), std::string::npos);
  EXPECT_NE(policy.find("frame-ancestors 'none'"), std::string::npos);
  EXPECT_EQ(policy.find("unsafe"), std::string::npos);
}

TEST(NetHttp, SigningInTurnsTheTokenIntoASessionOfItsOwn) {
  Bench bench;
  const auto sign_in = [&] {
    auto reply =
        http(bench, {.method = "GET", .target = "/?token=" + Bench::token, .headers = "", .body = ""});
    EXPECT_EQ(reply.status, 303);
    EXPECT_EQ(reply.headers["Location"], "/");
    const auto cookie = reply.headers["Set-Cookie"];
    EXPECT_TRUE(cookie.ends_with("; Path=/; Max-Age=604800; HttpOnly; SameSite=Strict")) << cookie;
    EXPECT_TRUE(cookie.starts_with("ferrobench_" + std::to_string(bench.port()) + "=")) << cookie;
    EXPECT_EQ(cookie.find(Bench::token), std::string::npos) << "other ports of this host are told it";
    return cookie.substr(0, cookie.find(';'));
  };
  const auto page = [&](const std::string& cookie) {
    return http(bench, {.method = "GET", .target = "/", .headers = "Cookie: " + cookie + "\r\n", .body = ""})
        .status;
  };
  const auto first = sign_in(), second = sign_in();
  EXPECT_NE(first, second);
  EXPECT_EQ(page(first), 200);
  EXPECT_EQ(page(second), 200);
  EXPECT_EQ(page("ferrobench_" + std::to_string(bench.port()) + "=" + Bench::token), 401);
  for (std::size_t i = 0; i + 1 < Admission::most_sessions; ++i) sign_in();
  EXPECT_EQ(page(first), 401) << "the oldest session ends where there are too many";
  EXPECT_EQ(page(second), 200);
}

TEST(NetHttp, RecordingInRanges) {
  Bench bench;
  const auto get = [&](const std::string& range) {
    return http(bench, {.method = "GET",
                        .target = "/recordings/loop.h5",
                        .headers = bearer + (range.empty() ? "" : "Range: " + range + "\r\n"),
                        .body = ""});
  };
  const auto size = std::to_string(bench.recording.size());
  auto whole = get("");
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.headers["Accept-Ranges"], "bytes");
  EXPECT_TRUE(whole.body == bench.recording);
  auto part = get("bytes=100000-199999");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.headers["Content-Range"], "bytes 100000-199999/" + size);
  EXPECT_TRUE(part.body == bench.recording.substr(100'000, 100'000));
  EXPECT_TRUE(get("bytes=299990-").body == bench.recording.substr(299'990));
  EXPECT_TRUE(get("bytes=-7").body == bench.recording.substr(299'993));
  EXPECT_TRUE(get("bytes=0-999999999").body == bench.recording);
  auto outside = get("bytes=300000-");
  EXPECT_EQ(outside.status, 416);
  EXPECT_EQ(outside.headers["Content-Range"], "bytes */" + size);
  EXPECT_EQ(get("bytes=5-2").status, 200);
  EXPECT_EQ(get("bytes=0-1,4-5").status, 200);
  EXPECT_EQ(get("bytes=-").status, 200);
  EXPECT_EQ(get("lines=1-2").status, 200);
}

// Sends the rest a byte at a time and far too slowly, and says what came back. A deadline that each byte put
// off would let it go on for half an hour.
std::string drip(const Bench& bench, const std::string& at_once, const std::string& slowly) {
  const int fd = connect_tcp(bench.port());
  send_all(fd, at_once);
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t at = 0; std::chrono::steady_clock::now() - start < std::chrono::seconds(10); ++at) {
    send_all(fd, std::string_view(slowly).substr(at % slowly.size(), 1));
    pollfd item{.fd = fd, .events = POLLIN, .revents = 0};
    if (poll(&item, 1, 20) > 0) break;
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5)) << "it is still waiting";
  auto out = read_all(fd);
  close(fd);
  return out;
}

TEST(NetHttp, SlowClientsAreGivenUp) {
  ServerOptions options;
  options.header_timeout = options.body_timeout = std::chrono::milliseconds(300);
  Bench bench(options);
  const auto start = "POST /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\n" + bearer + as_json;
  const std::vector<std::tuple<const char*, std::string, std::string>> slow{
      {"the head", "P", "OST /rpc HTTP/1.1\r\n"},
      {"a field", start, "X: yyyyyyyy"},
      {"fields without end", start, "X: y\r\n"},
      {"the body", start + "Content-Length: 50000\r\n\r\n", " "},
      {"chunks", start + "Transfer-Encoding: chunked\r\n\r\n", "1\r\n \r\n"},
      {"a chunk", start + "Transfer-Encoding: chunked\r\n\r\nffff\r\n", " "},
      {"empty lines", "", "\r\n"}};
  for (const auto& [what, at_once, slowly] : slow) {
    SCOPED_TRACE(what);
    const auto status = parse_reply(drip(bench, at_once, slowly)).status;
    EXPECT_TRUE(status == 0 || status == 400) << status;
  }
  EXPECT_EQ(bench.counted, 0);
}

TEST(NetHttp, SilentClientsAreGivenUp) {
  ServerOptions options;
  options.header_timeout = options.body_timeout = std::chrono::milliseconds(200);
  Bench bench(options);
  const std::string body = R"({"jsonrpc":"2.0","method":"count","id":1})";
  const auto head = "POST /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\n" + bearer + as_json;
  EXPECT_EQ(raw_exchange(bench.port(), ""), "");
  EXPECT_EQ(raw_exchange(bench.port(), head), "");
  EXPECT_EQ(raw_exchange(bench.port(), head + "Content-Length: 50\r\n\r\n{"), "");
  EXPECT_EQ(bench.counted, 0);
  const auto kept =
      raw_exchange(bench.port(), head + "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body);
  EXPECT_EQ(parse_reply(kept).status, 200) << "it closes after the reply, not instead of it";
}

TEST(NetHttp, ClientThatDoesNotTakeItsReplyIsGivenUp) {
  ServerOptions options;
  options.reply_timeout = std::chrono::milliseconds(300);
  options.max_connections = 1;
  Bench bench(options);
  const int fd = connect_tcp(bench.port());
  send_all(fd, "GET /large HTTP/1.1\r\nHost: " + bench.host() + "\r\n" + bearer + "\r\n");
  EXPECT_TRUE(eventually([&] { return http(bench, {}).status == 503; }));
  EXPECT_TRUE(eventually([&] { return http(bench, {}).status == 200; }));
  close(fd);
}

TEST(NetHttp, GarbageIsRefused) {
  Bench bench;
  EXPECT_EQ(parse_reply(raw_exchange(bench.port(), "hello daemon\r\n\r\n")).status, 400);
  EXPECT_EQ(parse_reply(raw_exchange(bench.port(), "POST /rpc HTTP/1.1\r\nHost : x\r\n\r\n")).status, 400);
  EXPECT_EQ(http(bench, {}).status, 200);
}

TEST(NetHttp, FullHouseSaysSo) {
  ServerOptions options;
  options.max_connections = 2;
  Bench bench(options);
  const Head slow{.body = R"({"jsonrpc":"2.0","method":"sleep","params":{"seconds":1},"id":1})"};
  std::vector<std::thread> guests;
  for (int i = 0; i < 2; ++i) guests.emplace_back([&] { EXPECT_EQ(http(bench, slow).status, 200); });
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const auto reply = http(bench, {});
  EXPECT_EQ(reply.status, 503);
  EXPECT_EQ(json::parse(reply.body)["name"], "busy");
  EXPECT_EQ(bench.counted, 0);
  EXPECT_EQ(Client::connect(bench.socket_path()).call("count"), 1)
      << "strangers keep the owner from his bench";
  for (auto& guest : guests) guest.join();
  EXPECT_EQ(http(bench, {}).status, 200);
}

TEST(NetHttp, StopLetsCallsUnderWayReply) {
  auto bench = std::make_unique<Bench>();
  const Head slow{.body = R"({"jsonrpc":"2.0","method":"sleep","params":{"seconds":0.4},"id":1})"};
  std::thread guest([&] { EXPECT_EQ(http(*bench, slow).status, 200); });
  std::this_thread::sleep_for(std::chrono::milliseconds(150));
  bench->server->stop();
  guest.join();
}

TEST(NetHttp, OnlyLoopbackWithoutTls) {
  ServerOptions options;
  options.token = Bench::token;
  EXPECT_TRUE(options.validate().empty());
  options.address = "::1";
  EXPECT_TRUE(options.validate().empty());
  options.address = "0.0.0.0";
  ASSERT_EQ(options.validate().size(), 1u);
  EXPECT_EQ(options.validate()[0].path, "/address");
  EXPECT_THROW(Bench bench(options), Error);
  EXPECT_NE(options.validate()[0].hint.find("--tls-certificate"), std::string::npos);
  options.tls_certificate = "bench.pem";
  EXPECT_EQ(options.validate().at(0).path, "/tls_key");
  options.tls_key = "bench.key";
  EXPECT_TRUE(options.validate().empty());
  options.address = "localhost";
  EXPECT_EQ(options.validate().size(), 1u);
}

TEST(NetHttp, TakenPortIsAnErrorThatSaysSo) {
  const Bench first;
  ServerOptions options;
  options.port = first.port();
  options.token = Bench::token;
  const Dispatcher rpc;
  Hub hub;
  try {
    const Server second(rpc, hub, options, {});
    FAIL() << "two daemons on one port";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::busy);
  }
}

}  // namespace
}  // namespace ferrobench::server
