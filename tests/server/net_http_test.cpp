// The door over HTTP: what is let in, what is refused and how, and what a refusal leaves undone.
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "net_bench.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

const std::string bearer = "Authorization: Bearer " + Bench::token + "\r\n";
const std::string as_json = "Content-Type: application/json\r\n";
const std::string upgrade =
    "Upgrade: websocket\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n";

struct Case {
  const char* what;
  Head head;
  int status;
  const char* name;  // of the refusal, "" if it is let in
  const char* says;  // part of the message
};

// PORT stands for the daemon's own port.
std::vector<Case> cases() {
  return {
      {"proper", {}, 200, "", ""},
      {"by name", {.host = "localhost:PORT"}, 200, "", ""},
      {"by upper-case name", {.host = "LocalHost:PORT"}, 200, "", ""},
      {"by IPv6", {.host = "[::1]:PORT"}, 200, "", ""},
      {"own page", {.headers = bearer + as_json + "Origin: http://127.0.0.1:PORT\r\n"}, 200, "", ""},
      {"charset", {.headers = bearer + "Content-Type: application/json; charset=utf-8\r\n"}, 200, "", ""},
      {"cookie", {.headers = as_json + "Cookie: a=b; ferrobench_PORT=" + Bench::token + "\r\n"}, 200, "", ""},

      {"rebound name", {.host = "evil.example:PORT"}, 403, "unauthorized", "Host"},
      {"no port", {.host = "127.0.0.1"}, 403, "unauthorized", "Host"},
      {"other port", {.host = "127.0.0.1:1"}, 403, "unauthorized", "Host"},
      {"two hosts", {.headers = bearer + as_json + "Host: evil.example\r\n"}, 403, "unauthorized", "Host"},
      {"prefix of host", {.host = "127.0.0.1:PORT.evil.example"}, 403, "unauthorized", "Host"},

      {"other site",
       {.headers = bearer + as_json + "Origin: http://evil.example\r\n"},
       403,
       "unauthorized",
       "Origin"},
      {"other port's page",
       {.headers = bearer + as_json + "Origin: http://127.0.0.1:1\r\n"},
       403,
       "unauthorized",
       "Origin"},
      {"no origin's page", {.headers = bearer + as_json + "Origin: null\r\n"}, 403, "unauthorized", "Origin"},
      {"https origin",
       {.headers = bearer + as_json + "Origin: https://127.0.0.1:PORT\r\n"},
       403,
       "unauthorized",
       "Origin"},

      {"no token", {.headers = as_json}, 401, "unauthorized", "token"},
      {"wrong token",
       {.headers = as_json + "Authorization: Bearer " + std::string(64, 'a') + "\r\n"},
       401,
       "unauthorized",
       "token"},
      {"short token", {.headers = as_json + "Authorization: Bearer a\r\n"}, 401, "unauthorized", "token"},
      {"basic",
       {.headers = as_json + "Authorization: Basic " + Bench::token + "\r\n"},
       401,
       "unauthorized",
       "token"},
      {"wrong cookie", {.headers = as_json + "Cookie: ferrobench_PORT=a\r\n"}, 401, "unauthorized", "token"},
      {"other daemon's cookie",
       {.headers = as_json + "Cookie: ferrobench_1=" + Bench::token + "\r\n"},
       401,
       "unauthorized",
       "token"},
      {"token in the address of /rpc",
       {.target = "/rpc?token=" + Bench::token, .headers = as_json},
       401,
       "unauthorized",
       "token"},
      {"page without token",
       {.method = "GET", .target = "/", .headers = "", .body = ""},
       401,
       "unauthorized",
       "token"},
      {"page with wrong token",
       {.method = "GET", .target = "/?token=a", .headers = "", .body = ""},
       401,
       "unauthorized",
       "token"},
      {"recording without token",
       {.method = "GET", .target = "/recordings/loop.h5", .headers = "", .body = ""},
       401,
       "unauthorized",
       "token"},

      {"a form's type",
       {.headers = bearer + "Content-Type: text/plain\r\n"},
       415,
       "invalid_params",
       "content type"},
      {"no type", {.headers = bearer}, 415, "invalid_params", "content type"},
      {"type in a parameter",
       {.headers = bearer + "Content-Type: text/plain; application/json\r\n"},
       415,
       "invalid_params",
       "content type"},

      {"put", {.method = "PUT"}, 405, "invalid_params", "PUT"},
      {"preflight", {.method = "OPTIONS", .body = ""}, 405, "invalid_params", "OPTIONS"},
      {"unknown method", {.method = "BREW"}, 405, "invalid_params", "BREW"},
      {"post to the page", {.target = "/"}, 405, "invalid_params", "POST"},
      {"post to a recording", {.target = "/recordings/loop.h5"}, 405, "invalid_params", "POST"},

      {"get without upgrade", {.method = "GET", .body = ""}, 426, "invalid_params", "WebSocket"},
      {"no such page", {.method = "GET", .target = "/nothing", .body = ""}, 404, "not_found", "path"},
      {"no such recording",
       {.method = "GET", .target = "/recordings/nothing", .body = ""},
       404,
       "not_found",
       "recording"},
      {"up and away",
       {.method = "GET", .target = "/recordings/../token", .body = ""},
       400,
       "invalid_params",
       "path"},
      {"up and away, encoded",
       {.method = "GET", .target = "/recordings/%2e%2e/token", .body = ""},
       400,
       "invalid_params",
       "path"},
      {"encoded slash",
       {.method = "GET", .target = "/recordings/a%2fb", .body = ""},
       400,
       "invalid_params",
       "path"},
      {"encoded zero", {.method = "GET", .target = "/a%00", .body = ""}, 400, "invalid_params", "path"},
      {"broken encoding", {.method = "GET", .target = "/a%4", .body = ""}, 400, "invalid_params", "path"},
      {"absolute target",
       {.method = "GET", .target = "http://evil.example/", .body = ""},
       400,
       "invalid_params",
       "path"},

      {"socket from another site",
       {.method = "GET", .headers = bearer + upgrade + "Origin: http://evil.example\r\n", .body = ""},
       403,
       "unauthorized",
       "Origin"},
      {"socket without token",
       {.method = "GET", .headers = upgrade, .body = ""},
       401,
       "unauthorized",
       "token"},
      {"long head",
       {.headers = bearer + as_json + "X: " + std::string(20'000, 'x') + "\r\n"},
       431,
       "invalid_params",
       "head"},
      {"long body", {.body = std::string(5u << 20, ' ')}, 413, "invalid_params", "too long"},
  };
}

std::string with_port(std::string text, std::uint16_t port) {
  for (auto at = text.find("PORT"); at != std::string::npos; at = text.find("PORT"))
    text.replace(at, 4, std::to_string(port));
  return text;
}

TEST(NetHttp, RefusalTable) {
  Bench bench;
  int let_in = 0;
  for (auto& c : cases()) {
    SCOPED_TRACE(c.what);
    c.head.host = with_port(c.head.host, bench.port());
    c.head.headers = with_port(c.head.headers, bench.port());
    const auto reply = http(bench, c.head);
    EXPECT_EQ(reply.status, c.status) << reply.body;
    const auto body = json::parse(reply.body, nullptr, false);
    ASSERT_TRUE(body.is_object()) << reply.body;
    if (c.status == 200) {
      ++let_in;
      EXPECT_EQ(body["result"], let_in);
    } else {
      EXPECT_EQ(body["name"], c.name);
      EXPECT_NE(body["message"].get<std::string>().find(c.says), std::string::npos) << body;
      EXPECT_FALSE(body["hint"].get<std::string>().empty());
      EXPECT_EQ(reply.headers.count("Access-Control-Allow-Origin"), 0u);
      EXPECT_EQ(reply.headers.count("Set-Cookie"), 0u);
    }
    EXPECT_EQ(bench.counted, let_in) << "a refused request changed something";
  }
  EXPECT_EQ(let_in, 7);
}

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

TEST(NetHttp, SigningInTurnsTheTokenIntoACookie) {
  Bench bench;
  auto reply = http(bench, {.method = "GET", .target = "/?token=" + Bench::token, .headers = "", .body = ""});
  EXPECT_EQ(reply.status, 303);
  EXPECT_EQ(reply.headers["Location"], "/");
  const auto cookie = reply.headers["Set-Cookie"];
  EXPECT_EQ(cookie, "ferrobench_" + std::to_string(bench.port()) + "=" + Bench::token +
                        "; Path=/; HttpOnly; SameSite=Strict");
  const auto page = http(bench, {.method = "GET",
                                 .target = "/",
                                 .headers = "Cookie: " + cookie.substr(0, cookie.find(';')) + "\r\n",
                                 .body = ""});
  EXPECT_EQ(page.status, 200);
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

TEST(NetHttp, SlowHeadIsGivenUp) {
  ServerOptions options;
  options.header_timeout = std::chrono::milliseconds(200);
  Bench bench(options);
  const auto start = std::chrono::steady_clock::now();
  const auto reply = parse_reply(raw_exchange(bench.port(), "POST /rpc HTTP/1.1\r\nHost: "));
  EXPECT_TRUE(reply.status == 408 || reply.status == 0) << reply.status;
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST(NetHttp, SlowBodyIsGivenUp) {
  ServerOptions options;
  options.body_timeout = std::chrono::milliseconds(200);
  Bench bench(options);
  raw_exchange(bench.port(), "POST /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\n" + bearer + as_json +
                                 "Content-Length: 50\r\n\r\n{");
  EXPECT_EQ(bench.counted, 0);
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

TEST(NetHttp, OnlyLoopbackUnlessToldOtherwise) {
  ServerOptions options;
  options.token = Bench::token;
  EXPECT_TRUE(options.validate().empty());
  options.address = "::1";
  EXPECT_TRUE(options.validate().empty());
  options.address = "0.0.0.0";
  ASSERT_EQ(options.validate().size(), 1u);
  EXPECT_EQ(options.validate()[0].path, "/address");
  EXPECT_THROW(Bench bench(options), Error);
  options.allow_remote = true;
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
