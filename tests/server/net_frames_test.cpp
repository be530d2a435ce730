// WebSocket frame by frame (RFC 6455), by a client that sends whatever it likes: the kinds of cases of the
// Autobahn test suite. Each row goes over the wire twice, in one piece and in small ones.
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>

#include "net_bench.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

enum First {
  text = 0x81,
  binary = 0x82,
  close_frame = 0x88,
  ping = 0x89,
  pong = 0x8a,
  text_begin = 0x01,
  binary_begin = 0x02,
  more = 0x00,
  last = 0x80
};

const std::string around = R"({"jsonrpc":"2.0","method":"echo","params":{"value":""},"id":1})";

// A request to echo, of so many bytes, or of a value.
std::string echo(const std::string& value) {
  return std::string(around).insert(around.find("\"\"}") + 1, value);
}
std::string echo(std::size_t bytes) {
  return echo(std::string(bytes - around.size(), 'x'));
}

std::string unmasked(int first, const std::string& payload) {
  return std::string{static_cast<char>(first), static_cast<char>(payload.size())} + payload;
}
// A frame's head that says its length in 2 or 8 bytes, whether that needs so many or not.
std::string long_head(int first, std::uint64_t length, int bytes) {
  std::string out{static_cast<char>(first), static_cast<char>(0x80 | (bytes == 2 ? 126 : 127))};
  for (int i = bytes - 1; i >= 0; --i) out += static_cast<char>(length >> (8 * i));
  return out + std::string(4, '\0');
}
std::string closing(int code, const std::string& reason = "") {
  return frame(close_frame, std::string{static_cast<char>(code >> 8), static_cast<char>(code)} + reason);
}
std::string in_fragments(const std::string& message, std::size_t size) {
  std::string out;
  for (std::size_t at = 0; at < message.size(); at += size)
    out += frame((at == 0 ? 1 : 0) | (at + size >= message.size() ? 0x80 : 0), message.substr(at, size));
  return out;
}
std::string repeated(const std::string& part, int times) {
  std::string out;
  for (int i = 0; i < times; ++i) out += part;
  return out;
}

// A connection that has become a WebSocket.
class Wire {
 public:
  explicit Wire(const Bench& bench, const std::string& extra = "") : fd_(connect_tcp(bench.port())) {
    const int at_once = 1;
    setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    send_all(fd_, "GET /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\nAuthorization: Bearer " + Bench::token +
                      "\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n" +
                      extra + "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
    while (head_.find("\r\n\r\n") == std::string::npos && fill()) {
    }
    const auto end = std::min(head_.size(), head_.find("\r\n\r\n") + 4);
    buffer_ = head_.substr(end);
    head_.resize(end);
  }
  ~Wire() { close(fd_); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  const std::string& head() const { return head_; }
  void send(const std::string& bytes, std::size_t piece) const {
    for (std::size_t at = 0; at < bytes.size(); at += piece)
      send_all(fd_, std::string_view(bytes).substr(at, piece));
  }

  // The next thing that the daemon says, in words; "end" when it has closed.
  std::string next() {
    while (true) {
      if (const auto said = take()) return *said;
      if (!fill()) return buffer_.empty() ? "end" : "half a frame";
    }
  }

 private:
  bool fill() {
    auto& into = head_.ends_with("\r\n\r\n") ? buffer_ : head_;
    std::array<char, 4096> chunk{};
    const ssize_t n = recv(fd_, chunk.data(), chunk.size(), 0);
    EXPECT_FALSE(n < 0 && errno == EAGAIN) << "the daemon neither spoke nor closed";
    if (n > 0) into.append(chunk.data(), static_cast<std::size_t>(n));
    return n > 0;
  }

  std::optional<std::string> take() {
    const auto byte = [this](std::size_t i) { return static_cast<unsigned char>(buffer_.at(i)); };
    if (buffer_.size() < 2) return std::nullopt;
    EXPECT_EQ(byte(0) & 0x70, 0) << "a reserved bit";
    EXPECT_EQ(byte(1) & 0x80, 0) << "a server does not mask";
    const int bytes = byte(1) < 126 ? 0 : byte(1) == 126 ? 2 : 8;
    const auto head = static_cast<std::size_t>(2 + bytes);
    if (buffer_.size() < head) return std::nullopt;
    std::uint64_t size = bytes == 0 ? byte(1) : 0;
    for (int i = 0; i < bytes; ++i) size = size << 8 | byte(static_cast<std::size_t>(2 + i));
    if (bytes > 0) {
      EXPECT_GE(size, bytes == 2 ? 126u : 65536u) << "the length in more bytes than it needs";
    }
    if (buffer_.size() < head + size) return std::nullopt;
    const int opcode = byte(0) & 15;
    const bool whole = (byte(0) & 0x80) != 0;
    auto payload = buffer_.substr(head, size);
    buffer_.erase(0, head + size);
    if (opcode >= 8) return in_words(opcode, payload);
    EXPECT_EQ(opcode, message_.empty() ? 1 : 0);
    message_ += payload;
    return whole ? std::optional(in_words(1, std::exchange(message_, ""))) : take();
  }

  static std::string in_words(int opcode, const std::string& payload) {
    const auto brief = payload.size() > 20 ? "of " + std::to_string(payload.size()) : payload;
    if (opcode == 8)
      return "close " + std::to_string(static_cast<unsigned char>(payload.at(0)) << 8 |
                                       static_cast<unsigned char>(payload.at(1)));
    if (opcode == 9) return "ping " + brief;
    if (opcode == 10) return payload.empty() ? "pong" : "pong " + brief;
    const auto reply = json::parse(payload, nullptr, false);
    if (reply.contains("error")) return "error " + reply["error"]["code"].dump();
    const auto value = reply.value("result", "");
    const bool sized = !value.empty() && value.find_first_not_of('x') == std::string::npos;
    return sized ? "echo " + std::to_string(value.size() + around.size()) : "echo '" + value + "'";
  }

  int fd_;
  std::string head_, buffer_, message_;
};

// What is sent, and what comes back for it.
struct Step {
  std::string bytes;
  std::vector<std::string> replies;
};
struct Row {
  std::string what;
  std::vector<Step> steps;
};

const std::vector<std::string> broken{"close 1002", "end"};
const std::vector<std::string> not_text{"close 1007", "end"};

void add_framing(std::vector<Row>& rows) {
  rows.push_back({"text of 0 bytes", {{frame(text, ""), {"error -32700"}}}});
  for (const std::size_t size : {100, 125, 126, 127, 128, 255, 256, 65535, 65536, 65537})
    rows.push_back({"text of " + std::to_string(size) + " bytes",
                    {{frame(text, echo(size)), {"echo " + std::to_string(size)}}}});
  for (const std::size_t size : {0, 125, 126, 65535, 65536})
    rows.push_back({"binary of " + std::to_string(size) + " bytes",
                    {{frame(binary, std::string(size, '\xfe')), {"close 1003", "end"}}}});
  rows.push_back({"unmasked text", {{unmasked(text, echo(100)), broken}}});
  rows.push_back({"unmasked ping", {{unmasked(ping, "a"), broken}}});
  rows.push_back({"unmasked close", {{unmasked(close_frame, ""), broken}}});
  rows.push_back({"length 5 in 2 bytes", {{long_head(text, 5, 2) + "hello", broken}}});
  rows.push_back({"length 125 in 2 bytes", {{long_head(text, 125, 2), broken}}});
  rows.push_back({"length 65535 in 8 bytes", {{long_head(text, 65535, 8), broken}}});
  rows.push_back({"ping with length in 2 bytes", {{long_head(ping, 5, 2) + "hello", broken}}});
}

void add_pings(std::vector<Row>& rows) {
  rows.push_back({"ping", {{frame(ping, ""), {"pong"}}}});
  rows.push_back({"ping with text", {{frame(ping, "Hello"), {"pong Hello"}}}});
  rows.push_back({"ping with bytes", {{frame(ping, "\xff\xfe\xfd"), {"pong \xff\xfe\xfd"}}}});
  rows.push_back({"ping of 125 bytes", {{frame(ping, std::string(125, '\xfe')), {"pong of 125"}}}});
  rows.push_back({"ping of 126 bytes", {{frame(ping, std::string(126, 'x')), broken}}});
  rows.push_back({"pong unasked", {{frame(pong, "") + frame(text, echo(80)), {"echo 80"}}}});
  rows.push_back({"pong with text unasked", {{frame(pong, "x") + frame(ping, "y"), {"pong y"}}}});
  rows.push_back({"pong of 126 bytes", {{frame(pong, std::string(126, 'x')), broken}}});
  rows.push_back({"ten pings",
                  {{repeated(frame(ping, "p"), 10), std::vector<std::string>(10, "pong p")},
                   {frame(text, echo(80)), {"echo 80"}}}});
}

void add_reserved(std::vector<Row>& rows) {
  for (int bits = 1; bits < 8; ++bits) {
    const auto name = "reserved bits " + std::to_string(bits);
    rows.push_back({name + " of text", {{frame(text | bits << 4, echo(80)), broken}}});
    rows.push_back({name + " of an empty text", {{frame(text | bits << 4, ""), broken}}});
    rows.push_back({name + " of ping", {{frame(ping | bits << 4, ""), broken}}});
    rows.push_back({name + " of close", {{frame(close_frame | bits << 4, ""), broken}}});
    rows.push_back({name + " after a message",
                    {{frame(text, echo(80)), {"echo 80"}}, {frame(text | bits << 4, echo(80)), broken}}});
  }
  for (const int opcode : {3, 4, 5, 6, 7, 11, 12, 13, 14, 15}) {
    const auto name = "opcode " + std::to_string(opcode);
    rows.push_back({name, {{frame(0x80 | opcode, ""), broken}}});
    rows.push_back({name + " with text", {{frame(0x80 | opcode, "Hello"), broken}}});
    rows.push_back({name + ", a fragment", {{frame(opcode, "Hello"), broken}}});
    rows.push_back({name + " within a message",
                    {{frame(text_begin, echo(80).substr(0, 9)) + frame(0x80 | opcode, ""), broken}}});
  }
}

void add_fragments(std::vector<Row>& rows) {
  const auto whole = echo(100), one = whole.substr(0, 30), two = whole.substr(30);
  rows.push_back({"ping in fragments", {{frame(0x09, "a") + frame(last, "b"), broken}}});
  rows.push_back({"pong in fragments", {{frame(0x0a, "a") + frame(last, "b"), broken}}});
  rows.push_back({"close in fragments", {{frame(0x08, "") + frame(last, ""), broken}}});
  rows.push_back({"two fragments", {{frame(text_begin, one) + frame(last, two), {"echo 100"}}}});
  rows.push_back({"fragments of a byte", {{in_fragments(whole, 1), {"echo 100"}}}});
  rows.push_back(
      {"empty fragments",
       {{frame(text_begin, "") + frame(more, "") + frame(more, whole) + frame(more, "") + frame(last, ""),
         {"echo 100"}}}});
  rows.push_back({"only empty fragments",
                  {{frame(text_begin, "") + frame(more, "") + frame(last, ""), {"error -32700"}}}});
  rows.push_back({"ping between fragments",
                  {{frame(text_begin, one) + frame(ping, "p") + frame(last, two), {"pong p", "echo 100"}}}});
  rows.push_back({"pings between fragments, later the rest",
                  {{frame(text_begin, one) + frame(ping, "1") + frame(ping, "2"), {"pong 1", "pong 2"}},
                   {frame(pong, "x") + frame(last, two), {"echo 100"}}}});
  rows.push_back(
      {"close between fragments", {{frame(text_begin, one) + closing(1000), {"close 1000", "end"}}}});
  rows.push_back({"the rest without a start", {{frame(last, whole), broken}}});
  rows.push_back({"the middle without a start", {{frame(more, one) + frame(last, two), broken}}});
  rows.push_back({"an empty rest without a start", {{frame(last, ""), broken}}});
  rows.push_back(
      {"the rest after a whole message", {{frame(text, whole), {"echo 100"}}, {frame(last, two), broken}}});
  rows.push_back({"a message within a message", {{frame(text_begin, one) + frame(text, whole), broken}}});
  rows.push_back({"a start within a message", {{frame(text_begin, one) + frame(text_begin, two), broken}}});
  rows.push_back({"bytes within a text", {{frame(text_begin, one) + frame(binary, two), broken}}});
  rows.push_back(
      {"binary fragments", {{frame(binary_begin, "a") + frame(last, "b"), {"close 1003", "end"}}}});
  rows.push_back(
      {"two messages in fragments",
       {{in_fragments(echo("one"), 7), {"echo 'one'"}}, {in_fragments(echo("two"), 9), {"echo 'two'"}}}});
}

void add_utf8(std::vector<Row>& rows) {
  for (const std::string good :
       {"\xc3\xa4", "\xe2\x82\xac", "\xf0\x9f\x98\x80", "\xce\xba\xe1\xbd\xb9\xcf\x83\xce\xbc\xce\xb5",
        "\xc2\x80", "\xdf\xbf", "\xe0\xa0\x80", "\xed\x9f\xbf", "\xee\x80\x80", "\xef\xbf\xbf",
        "\xef\xbf\xbe", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf"}) {
    const auto message = echo(good);
    const auto cut = message.find(good) + 1;  // within the character
    const std::vector<std::string> reply{"echo '" + good + "'"};
    rows.push_back({"text " + good, {{frame(text, message), reply}}});
    rows.push_back({"text " + good + " in fragments",
                    {{frame(text_begin, message.substr(0, cut)) + frame(last, message.substr(cut)), reply}}});
    rows.push_back({"text " + good + " in fragments, ping between",
                    {{frame(text_begin, message.substr(0, cut)) + frame(ping, "p"), {"pong p"}},
                     {frame(last, message.substr(cut)), reply}}});
  }
  const std::vector<std::pair<const char*, std::string>> bad{
      {"a lone continuation", "\x80"},
      {"continuations only", "\x80\xbf\x80\xbf"},
      {"a start only", "\xc3"},
      {"two starts", "\xc3\xc3"},
      {"two of three bytes", "\xe2\x82"},
      {"three of four bytes", "\xf0\x9f\x98"},
      {"slash in 2 bytes", "\xc0\xaf"},
      {"slash in 3 bytes", "\xe0\x80\xaf"},
      {"slash in 4 bytes", "\xf0\x80\x80\xaf"},
      {"zero in 2 bytes", "\xc0\x80"},
      {"U+07FF in 3 bytes", "\xe0\x9f\xbf"},
      {"U+FFFF in 4 bytes", "\xf0\x8f\xbf\xbf"},
      {"surrogate U+D800", "\xed\xa0\x80"},
      {"surrogate U+DFFF", "\xed\xbf\xbf"},
      {"a pair of surrogates", "\xed\xa0\x80\xed\xb0\x80"},
      {"beyond U+10FFFF", "\xf4\x90\x80\x80"},
      {"F5", "\xf5\x80\x80\x80"},
      {"5 bytes", "\xf8\x88\x80\x80\x80"},
      {"6 bytes", "\xfc\x84\x80\x80\x80\x80"},
      {"FE", "\xfe"},
      {"FF", "\xff"},
  };
  for (const auto& [what, bytes] : bad) {
    const auto message = echo(bytes);
    const auto cut = message.find(bytes) + 1;
    rows.push_back({std::string("not UTF-8: ") + what, {{frame(text, message), not_text}}});
    rows.push_back({std::string("not UTF-8, at the end: ") + what, {{frame(text, bytes), not_text}}});
    rows.push_back(
        {std::string("not UTF-8, in fragments: ") + what,
         {{frame(text_begin, message.substr(0, cut)) + frame(last, message.substr(cut)), not_text}}});
  }
}

void add_closes(std::vector<Row>& rows) {
  rows.push_back({"close", {{frame(close_frame, ""), {"close 1000", "end"}}}});
  rows.push_back({"close after a message",
                  {{frame(text, echo(80)), {"echo 80"}}, {frame(close_frame, ""), {"close 1000", "end"}}}});
  rows.push_back({"close with half a code", {{frame(close_frame, "\x03"), broken}}});
  rows.push_back({"close with a reason", {{closing(1000, "bye"), {"close 1000", "end"}}}});
  rows.push_back(
      {"close with the longest reason", {{closing(1000, std::string(123, 'x')), {"close 1000", "end"}}}});
  rows.push_back({"close with too long a reason", {{closing(1000, std::string(124, 'x')), broken}}});
  rows.push_back({"close with a reason that is not UTF-8", {{closing(1000, "\xed\xa0\x80"), broken}}});
  rows.push_back({"two closes", {{closing(1000) + closing(1000), {"close 1000", "end"}}}});
  rows.push_back({"ping after close", {{closing(1000) + frame(ping, ""), {"close 1000", "end"}}}});
  rows.push_back({"text after close", {{closing(1000) + frame(text, echo(80)), {"close 1000", "end"}}}});
  rows.push_back({"the rest after close",
                  {{frame(text_begin, "{") + closing(1000) + frame(last, "}"), {"close 1000", "end"}}}});
  for (const int code : {1000, 1001, 1002, 1003, 1007, 1008, 1009, 1010, 1011, 3000, 3999, 4000, 4999})
    rows.push_back(
        {"close " + std::to_string(code), {{closing(code), {"close " + std::to_string(code), "end"}}}});
  for (const int code : {0, 1, 999, 1004, 1005, 1006, 1014, 1015, 1016, 1100, 2000, 2999})
    rows.push_back({"close " + std::to_string(code), {{closing(code), broken}}});
}

constexpr std::size_t limit = 100'000;

void add_limits(std::vector<Row>& rows) {
  const std::vector<std::string> too_big{"close 1009", "end"};
  rows.push_back({"as long as may be", {{frame(text, echo(limit)), {"echo 100000"}}}});
  rows.push_back({"a byte more", {{frame(text, std::string(limit + 1, ' ')), too_big}}});
  rows.push_back({"as long as may be, in fragments", {{in_fragments(echo(limit), 1'000), {"echo 100000"}}}});
  rows.push_back(
      {"a byte more in fragments", {{in_fragments(std::string(limit + 1, ' '), 10'000), too_big}}});
  rows.push_back({"a length of 2^40, announced", {{long_head(text, 1ull << 40, 8), too_big}}});
  rows.push_back({"a length of 2^63 - 1, announced", {{long_head(text, ~0ull >> 1, 8), too_big}}});
  rows.push_back({"a fragment of 2^63 - 1 bytes behind another",
                  {{frame(text_begin, "ab") + long_head(last, ~0ull >> 1, 8), too_big}}});
}

std::vector<Row> table() {
  std::vector<Row> rows;
  add_framing(rows);
  add_pings(rows);
  add_reserved(rows);
  add_fragments(rows);
  add_utf8(rows);
  add_closes(rows);
  add_limits(rows);
  return rows;
}

TEST(NetFrames, Table) {
  ServerOptions options;
  options.max_body_bytes = limit;
  options.header_timeout = std::chrono::milliseconds(300);  // also of a client that does not answer a close
  Bench bench(options);
  int sent = 0;
  for (const auto& row : table()) {
    std::size_t bytes = 0;
    for (const auto& step : row.steps) bytes += step.bytes.size();
    for (const std::size_t piece : {bytes, bytes < 1'000 ? std::size_t{1} : std::size_t{997}}) {
      SCOPED_TRACE(row.what + ", " + std::to_string(piece) + " bytes at a time");
      Wire wire(bench);
      ASSERT_TRUE(wire.head().starts_with("HTTP/1.1 101 ")) << wire.head();
      std::string end;
      for (const auto& [text_to_send, replies] : row.steps) {
        wire.send(text_to_send, piece);
        for (const auto& reply : replies) EXPECT_EQ(end = wire.next(), reply);
      }
      if (end != "end") {  // nothing else was said, and it still listens
        wire.send(closing(1000), piece);
        EXPECT_EQ(wire.next(), "close 1000");
        EXPECT_EQ(wire.next(), "end");
      }
      ++sent;
    }
  }
  EXPECT_GT(sent, 500);
  EXPECT_EQ(bench.counted, 0);
  EXPECT_EQ(http(bench, {}).status, 200);
}

TEST(NetFrames, CompressionIsNotAgreedTo) {
  Bench bench;
  Wire wire(bench, "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n");
  EXPECT_TRUE(wire.head().starts_with("HTTP/1.1 101 "));
  EXPECT_NE(wire.head().find("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), std::string::npos);
  EXPECT_EQ(wire.head().find("Sec-WebSocket-Extensions"), std::string::npos);
  wire.send(frame(text | 0x40, "\xf2\x48\xcd\xc9\xc9\x07"), 100);
  EXPECT_EQ(wire.next(), "close 1002");
}

// Whoever is told goodbye and does not leave is closed all the same, and makes room.
TEST(NetFrames, ClosedEvenIfTheClientStays) {
  ServerOptions options;
  options.max_connections = 1;
  options.header_timeout = options.idle_timeout = std::chrono::milliseconds(300);
  Bench bench(options);
  for (const auto& last_words : {frame(text | 0x10, "x"), frame(binary, "x"), closing(1000)}) {
    Wire stays(bench);
    ASSERT_TRUE(stays.head().starts_with("HTTP/1.1 101 "));
    stays.send(last_words, 100);
    EXPECT_TRUE(stays.next().starts_with("close "));
    EXPECT_TRUE(eventually([&] { return http(bench, {}).status == 200; }));
  }
}

}  // namespace
}  // namespace ferrobench::server
