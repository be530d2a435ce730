// Who is refused: one table, a row for each thing that may be wrong with a request, by every way in. What is
// refused is told why and how to put it right, and changes nothing: not a run, limit, device, lease,
// subscription or file.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "base/unix_socket.h"
#include "engine_bench.h"
#include "model/model.h"
#include "net_bench.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

// POST /rpc, a WebSocket at /rpc, a range of a recording's file; a line through the Unix socket.
enum Way : unsigned { post = 1, websocket = 2, file = 4, any_http = post | websocket | file, local = 8 };

// What differs from a proper request. Lower case: a part of it (method, target, query, version, body), else a
// header field; "+Field" is one more of them, "-Field" takes it away. PORT and TOKEN stand for the daemon's
// own.
using Edits = std::vector<std::pair<std::string, std::string>>;

struct Row {
  const char* what;
  unsigned ways;
  Edits edits;
  int status;  // of HTTP; of the JSON-RPC error where the Unix socket is asked
  const char* name;
  const char* says;  // part of the message
};

std::string call(const std::string& method, const json& params) {
  return json{{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", 1}}.dump();
}

std::string repeated(const std::string& text, int times) {
  std::string out;
  for (int i = 0; i < times; ++i) out += text;
  return out;
}

const std::string token_short = Bench::token.substr(0, 63);

std::vector<Row> table() {
  constexpr auto unauthorized = "unauthorized", invalid = "invalid_params", none = "not_found";
  return {
      // Host: a name that somebody else's server resolves to this machine is not ours.
      {"another name", any_http, {{"Host", "evil.example:PORT"}}, 403, unauthorized, "Host"},
      {"another address", any_http, {{"Host", "192.168.1.9:PORT"}}, 403, unauthorized, "Host"},
      {"no host", any_http, {{"-Host", ""}}, 403, unauthorized, "Host"},
      {"an empty host", any_http, {{"Host", ""}}, 403, unauthorized, "Host"},
      {"a host without port", any_http, {{"Host", "127.0.0.1"}}, 403, unauthorized, "Host"},
      {"another port", any_http, {{"Host", "127.0.0.1:1"}}, 403, unauthorized, "Host"},
      {"a name that begins like ours",
       any_http,
       {{"Host", "127.0.0.1:PORT.evil"}},
       403,
       unauthorized,
       "Host"},
      {"a name with a dot behind", any_http, {{"Host", "localhost.:PORT"}}, 403, unauthorized, "Host"},
      {"a user before the host", any_http, {{"Host", "localhost:PORT@evil"}}, 403, unauthorized, "Host"},
      {"an address without brackets", any_http, {{"Host", "::1:PORT"}}, 403, unauthorized, "Host"},
      {"two hosts", any_http, {{"+Host", "evil.example"}}, 403, unauthorized, "Host"},
      {"our host twice", any_http, {{"+Host", "127.0.0.1:PORT"}}, 403, unauthorized, "Host"},

      // Origin: only the daemon's own page.
      {"another site", any_http, {{"Origin", "http://evil.example"}}, 403, unauthorized, "Origin"},
      {"another port's page", any_http, {{"Origin", "http://127.0.0.1:1"}}, 403, unauthorized, "Origin"},
      {"a page without origin", any_http, {{"Origin", "null"}}, 403, unauthorized, "Origin"},
      {"an empty origin", any_http, {{"Origin", ""}}, 403, unauthorized, "Origin"},
      {"another scheme", any_http, {{"Origin", "https://127.0.0.1:PORT"}}, 403, unauthorized, "Origin"},
      {"a file's page", any_http, {{"Origin", "file://"}}, 403, unauthorized, "Origin"},
      {"an extension", any_http, {{"Origin", "chrome-extension://abc"}}, 403, unauthorized, "Origin"},
      {"an origin that begins like ours",
       any_http,
       {{"Origin", "http://127.0.0.1:PORT.evil"}},
       403,
       unauthorized,
       "Origin"},
      {"two origins",
       any_http,
       {{"Origin", "http://127.0.0.1:PORT"}, {"+Origin", "http://evil.example"}},
       403,
       unauthorized,
       "Origin"},

      // The token.
      {"no token", any_http, {{"-Authorization", ""}}, 401, unauthorized, "token"},
      {"another token",
       any_http,
       {{"Authorization", "Bearer " + std::string(64, 'a')}},
       401,
       unauthorized,
       "token"},
      {"all but a digit of it",
       any_http,
       {{"Authorization", "Bearer " + token_short}},
       401,
       unauthorized,
       "token"},
      {"more than the token", any_http, {{"Authorization", "Bearer TOKEN0"}}, 401, unauthorized, "token"},
      {"an empty token", any_http, {{"Authorization", "Bearer "}}, 401, unauthorized, "token"},
      {"another scheme of it", any_http, {{"Authorization", "Basic TOKEN"}}, 401, unauthorized, "token"},
      {"the token without scheme", any_http, {{"Authorization", "TOKEN"}}, 401, unauthorized, "token"},
      {"two tokens", any_http, {{"+Authorization", "Bearer TOKEN"}}, 401, unauthorized, "token"},
      {"a wrong one beside the cookie",
       any_http,
       {{"Authorization", "Bearer x"}, {"Cookie", "ferrobench_PORT=TOKEN"}},
       401,
       unauthorized,
       "token"},
      {"a wrong cookie",
       any_http,
       {{"-Authorization", ""}, {"Cookie", "ferrobench_PORT=a"}},
       401,
       unauthorized,
       "token"},
      {"the token as a cookie",
       any_http,
       {{"-Authorization", ""}, {"Cookie", "ferrobench_PORT=TOKEN"}},
       401,
       unauthorized,
       "token"},
      {"another daemon's cookie",
       any_http,
       {{"-Authorization", ""}, {"Cookie", "ferrobench_1=TOKEN"}},
       401,
       unauthorized,
       "token"},
      {"the token in the address",
       any_http,
       {{"-Authorization", ""}, {"query", "?token=TOKEN"}},
       401,
       unauthorized,
       "token"},

      // Content type: what a form of another site can send is not JSON.
      {"no type", post, {{"-Content-Type", ""}}, 415, invalid, "content type"},
      {"text", post, {{"Content-Type", "text/plain"}}, 415, invalid, "content type"},
      {"a form", post, {{"Content-Type", "application/x-www-form-urlencoded"}}, 415, invalid, "content type"},
      {"a form with files", post, {{"Content-Type", "multipart/form-data"}}, 415, invalid, "content type"},
      {"JSON in a parameter",
       post,
       {{"Content-Type", "text/plain; application/json"}},
       415,
       invalid,
       "content type"},
      {"JSON and text",
       post,
       {{"Content-Type", "application/json, text/plain"}},
       415,
       invalid,
       "content type"},
      {"two types", post, {{"+Content-Type", "text/plain"}}, 415, invalid, "content type"},
      {"a type that begins like JSON",
       post,
       {{"Content-Type", "application/jsonp"}},
       415,
       invalid,
       "content type"},

      // Method.
      {"put", post | file, {{"method", "PUT"}}, 405, invalid, "PUT"},
      {"delete", post | file, {{"method", "DELETE"}}, 405, invalid, "DELETE"},
      {"patch", post | file, {{"method", "PATCH"}}, 405, invalid, "PATCH"},
      {"head", post | file, {{"method", "HEAD"}}, 405, invalid, "HEAD"},
      {"trace", post | file, {{"method", "TRACE"}}, 405, invalid, "TRACE"},
      {"the question before a request from another site",
       any_http,
       {{"method", "OPTIONS"}},
       405,
       invalid,
       "OPTIONS"},
      {"lower case", post | websocket, {{"method", "post"}}, 405, invalid, "post"},
      {"an unknown one", any_http, {{"method", "BREW"}}, 405, invalid, "BREW"},
      {"a proxy's", post, {{"method", "CONNECT"}, {"target", "127.0.0.1:80"}}, 400, invalid, "path"},
      {"post to a recording", file, {{"method", "POST"}}, 405, invalid, "POST"},
      {"post to the page", post, {{"target", "/"}}, 405, invalid, "POST"},

      // Transport.
      {"get without upgrade", websocket, {{"-Upgrade", ""}}, 426, invalid, "WebSocket"},
      {"upgrade without connection", websocket, {{"Connection", "keep-alive"}}, 426, invalid, "WebSocket"},
      {"upgrade to something else", websocket, {{"Upgrade", "h2c"}}, 426, invalid, "WebSocket"},
      {"upgrade of HTTP/1.0", websocket, {{"version", "HTTP/1.0"}}, 426, invalid, "WebSocket"},
      {"an old WebSocket", websocket, {{"Sec-WebSocket-Version", "8"}}, 426, invalid, "WebSocket"},
      {"no version", websocket, {{"-Sec-WebSocket-Version", ""}}, 426, invalid, "WebSocket"},
      {"no key", websocket, {{"-Sec-WebSocket-Key", ""}}, 426, invalid, "WebSocket"},
      {"a short key", websocket, {{"Sec-WebSocket-Key", "AAAA"}}, 426, invalid, "WebSocket"},
      {"a long key", websocket, {{"Sec-WebSocket-Key", std::string(2000, 'A')}}, 426, invalid, "WebSocket"},
      {"a frame before the answer", websocket, {}, 400, invalid, "WebSocket"},
      {"upgrade by post", websocket, {{"method", "POST"}}, 415, invalid, "content type"},
      {"a WebSocket elsewhere", websocket, {{"target", "/live"}}, 404, none, "path"},
      {"HTTP/2", any_http, {{"version", "HTTP/2.0"}}, 400, invalid, "HTTP"},
      {"no version of HTTP", any_http, {{"version", ""}}, 400, invalid, "HTTP"},
      {"another protocol", any_http, {{"version", "SIP/2.0"}}, 400, invalid, "HTTP"},

      // Framing: two readers of one request must not find different ends of it.
      {"two lengths", post, {{"+Content-Length", "5"}}, 400, invalid, "HTTP"},
      {"a length and chunks", post, {{"Transfer-Encoding", "chunked"}}, 400, invalid, "HTTP"},
      {"a negative length", post, {{"Content-Length", "-1"}}, 400, invalid, "HTTP"},
      {"a length in words", post, {{"Content-Length", "ten"}}, 400, invalid, "HTTP"},
      {"a length beyond 64 bits", post, {{"Content-Length", "18446744073709551621"}}, 400, invalid, "HTTP"},
      {"a chunk's length in words",
       post,
       {{"-Content-Length", ""}, {"Transfer-Encoding", "chunked"}, {"body", "ten\r\n{}\r\n0\r\n\r\n"}},
       400,
       invalid,
       "HTTP"},
      {"a field before the colon a space", any_http, {{"X ", "y"}}, 400, invalid, "HTTP"},
      {"a field with a zero byte", any_http, {{"X", std::string("a\0b", 3)}}, 400, invalid, "HTTP"},

      // Size.
      {"a long body", post, {{"body", std::string(70'000, ' ')}}, 413, invalid, "too long"},
      {"a long body announced", post, {{"Content-Length", "999999999999"}}, 413, invalid, "too long"},
      {"long chunks",
       post,
       {{"-Content-Length", ""},
        {"Transfer-Encoding", "chunked"},
        {"body", "11170\r\n" + std::string(70'000, ' ') + "\r\n0\r\n\r\n"}},
       413,
       invalid,
       "too long"},
      {"a long field", any_http, {{"X", std::string(5'000, 'x')}}, 431, invalid, "head"},
      {"many fields", any_http, {{"X", repeated("y\r\nX: ", 1'000)}}, 431, invalid, "head"},
      {"a long address", any_http, {{"query", "?" + std::string(5'000, 'x')}}, 431, invalid, "head"},
      {"a long line", local, {{"body", std::string(70'000, ' ')}}, -32700, invalid, "too long"},

      // What is said, once it is heard: JSON-RPC.
      {"no JSON", post | local, {{"body", "hello"}}, -32700, "parse_error", "JSON"},
      {"HTTP", local, {{"body", "POST /rpc HTTP/1.1"}}, -32700, "parse_error", "JSON"},
      {"nothing", post, {{"body", ""}}, -32700, "parse_error", "JSON"},
      {"not UTF-8", post | local, {{"body", "\"\xc3\x28\""}}, -32700, "parse_error", "JSON"},
      {"deep arrays", post | local, {{"body", std::string(60'000, '[')}}, -32700, "parse_error", "deep"},
      {"deep objects", post | local, {{"body", repeated("{\"a\":", 12'000)}}, -32700, "parse_error", "deep"},
      {"a deep parameter",
       post | local,
       {{"body", R"({"jsonrpc":"2.0","id":1,"method":"run.start","params":)" + std::string(500, '[') +
                     std::string(500, ']') + "}"}},
       -32700,
       "parse_error",
       "deep"},
      {"a long batch",
       post | local,
       {{"body", "[" + repeated("1,", 500) + "1]"}},
       -32600,
       "invalid_request",
       "batch"},

      // Paths: a recording is a plain file of the store.
      {"a folder up", file, {{"target", "/recordings/../secret.h5"}}, 400, invalid, "path"},
      {"a folder up, encoded", file, {{"target", "/recordings/%2e%2e/secret.h5"}}, 400, invalid, "path"},
      {"a folder up, encoded slash", file, {{"target", "/recordings/..%2fsecret.h5"}}, 400, invalid, "path"},
      {"encoded slash", file, {{"target", "/recordings/a%2fb.h5"}}, 400, invalid, "path"},
      {"encoded twice", file, {{"target", "/recordings/%252e%252e%252fsecret.h5"}}, 404, none, "recording"},
      {"backslash", file, {{"target", "/recordings/..\\secret.h5"}}, 400, invalid, "path"},
      {"encoded backslash", file, {{"target", "/recordings/..%5csecret.h5"}}, 400, invalid, "path"},
      {"zero byte", file, {{"target", "/recordings/old.h5%00.csv"}}, 400, invalid, "path"},
      {"broken encoding", file, {{"target", "/recordings/old.h5%4"}}, 400, invalid, "path"},
      {"another machine's",
       file,
       {{"target", "http://evil.example/recordings/old.h5"}},
       400,
       invalid,
       "path"},
      {"a hidden file", file, {{"target", "/recordings/.hidden.h5"}}, 400, invalid, "path"},
      {"a folder below", file, {{"target", "/recordings/folder/old.h5"}}, 404, none, "recording"},
      {"two slashes", file, {{"target", "/recordings//etc/passwd"}}, 404, none, "recording"},
      {"no name", file, {{"target", "/recordings/"}}, 404, none, "recording"},
      {"no such recording", file, {{"target", "/recordings/older.h5"}}, 404, none, "recording"},
      {"a folder", file, {{"target", "/recordings/folder.h5"}}, 404, none, "recording"},
      {"a pipe", file, {{"target", "/recordings/pipe.h5"}}, 404, none, "recording"},
      {"a link", file, {{"target", "/recordings/link.h5"}}, 404, none, "recording"},
      {"a link's CSV", file, {{"target", "/recordings/link.csv"}}, 404, none, "recording"},
      {"a file of the store", file, {{"target", "/secret.h5"}}, 404, none, "path"},
      {"behind the end", file, {{"Range", "bytes=99999999-"}}, 416, invalid, "range"},
      {"nothing of it", file, {{"Range", "bytes=-0"}}, 416, invalid, "range"},
      {"a path as name",
       post | local,
       {{"body", call("recording.info", {{"name", "../secret"}})}},
       -32602,
       invalid,
       "name"},
      {"a whole path as name",
       post | local,
       {{"body", call("recording.delete", {{"name", "/etc/passwd"}})}},
       -32602,
       invalid,
       "name"},
      {"a zero byte in a name",
       post | local,
       {{"body", call("recording.delete", {{"name", std::string("old\0x", 5)}})}},
       -32602,
       invalid,
       "name"},
      {"a link as name",
       post | local,
       {{"body", call("recording.info", {{"name", "link"}})}},
       -32001,
       none,
       "link"},
      {"a link to delete",
       post | local,
       {{"body", call("recording.delete", {{"name", "link"}})}},
       -32001,
       none,
       "link"},
      {"a link to play",
       post | local,
       {{"body", call("run.start", {{"device", "replay:link"}})}},
       -32001,
       none,
       "link"},
      {"a path to play",
       post | local,
       {{"body", call("run.start", {{"device", "replay:../secret"}})}},
       -32602,
       invalid,
       "name"},
      {"a path as a model's name",
       post | local,
       {{"body", call("model.put", {{"name", "../secret"}, {"model", json::object()}})}},
       -32602,
       invalid,
       "name"},
  };
}

// A whole bench behind a door, and everything about it that a request could change.
class Refusals : public testing::Test {
 protected:
  Refusals() {
    add_all_methods(rpc, engine);
    engine.wait(engine.start(request(trapezium(0.05, 0.05), true)).run);
    const auto recordings = engine.store().recordings();
    std::filesystem::rename(recordings / (engine.store().recording_names().at(0) + ".h5"),
                            recordings / "old.h5");
    std::ofstream(folder.path / "secret.h5") << secret;
    std::ofstream(recordings / ".hidden.h5") << secret;
    std::filesystem::create_directory(recordings / "folder.h5");
    std::filesystem::create_symlink(folder.path / "secret.h5", recordings / "link.h5");
    std::filesystem::create_symlink(folder.path / "secret.h5", recordings / "link.csv");
    EXPECT_EQ(mkfifo((recordings / "pipe.h5").c_str(), 0600), 0);

    ServerOptions options;
    options.port = 0;
    options.token = Bench::token;
    options.unix_socket = folder.path / "rpc.sock";
    options.max_header_bytes = 4096;
    options.max_body_bytes = 65536;
    server.emplace(
        rpc, hub, options,
        Content{.asset = nullptr,
                .recording = [this](const std::string& name) { return engine.store().download(name); },
                .disconnected = nullptr});
  }
  ~Refusals() override { server.reset(); }

  json state() {
    json files = json::object();
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path))
      files[entry.path().string()] = {entry.is_regular_file() ? entry.file_size() : 0, entry.is_symlink()};
    return {{"limits", write_json(engine.limits())},
            {"run", engine.status().run},
            {"runs", engine.runs().size()},
            {"devices", engine.open_devices()},
            {"models", engine.store().model_names()},
            {"files", files},
            {"lease", engine.lease().status().holder},
            {"subscribed", hub.wanted("run")}};
  }

  // One of everything that changes something.
  static std::string changes() {
    const auto one = [](const std::string& method, const json& params) {
      return json::parse(call(method, params));
    };
    const json model = model::to_json(model::library_model("soft-pzt"));
    return json{
        one("limits.set", {{"field_max", 1e6}}),
        one("model.put", {{"name", "mine"}, {"model", model}}),
        one("device.open", {{"device", "virtual"}}),
        one("recording.delete", {{"name", "old"}}),
        one("lease.acquire", json::object()),
        one("subscribe", {{"topic", "run"}}),
        one("run.start", {{"protocol", trapezium(0.05, 0.05)}, {"model", "soft-pzt"}, {"fast", true}})}
        .dump();
  }

  std::string substituted(std::string text) const {
    for (const auto& [name, value] :
         {std::pair<std::string, std::string>{"PORT", std::to_string(server->port())},
          {"TOKEN", Bench::token}})
      for (auto at = text.find(name); at != std::string::npos; at = text.find(name, at + value.size()))
        text.replace(at, name.size(), value);
    return text;
  }

  // A request as it goes over the wire, with a second one behind it, which must not be heard if the first is
  // refused.
  std::string text_of(Way way, const Edits& edits) const {
    std::string method = way == post ? "POST" : "GET", target = way == file ? "/recordings/old.h5" : "/rpc",
                query;
    std::string version = "HTTP/1.1", body = way == post ? changes() : "";
    std::vector<std::pair<std::string, std::string>> fields{
        {"Host", "127.0.0.1:PORT"},
        {"Authorization", "Bearer TOKEN"},
        {"Connection", way == websocket ? "Upgrade" : "close"}};
    if (way == post)
      fields.insert(fields.end(),
                    {{"Content-Type", "application/json"}, {"Content-Length", ""}});  // the body's
    if (way == file) fields.emplace_back("Range", "bytes=0-9");
    if (way == websocket)
      fields.insert(fields.end(), {{"Upgrade", "websocket"},
                                   {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="},
                                   {"Sec-WebSocket-Version", "13"}});
    for (const auto& [key, value] : edits) {
      const auto named = [&key = key](const auto& f) {
        return f.first == key.substr(key.front() == '-' ? 1 : 0);
      };
      if (key == "method")
        method = value;
      else if (key == "target")
        target = value;
      else if (key == "query")
        query = value;
      else if (key == "version")
        version = value;
      else if (key == "body")
        body = value;
      else if (key.front() == '+')
        fields.emplace_back(key.substr(1), value);
      else if (key.front() == '-')
        std::erase_if(fields, named);
      else if (const auto at = std::ranges::find_if(fields, named); at != fields.end())
        at->second = value;
      else
        fields.emplace_back(key, value);
    }
    if (way == local) return body + "\n";
    std::string head = method + " " + target + query + " " + version + "\r\n";
    for (const auto& [name, value] : fields)
      head += name + ": " +
              (name == "Content-Length" && value.empty() ? std::to_string(body.size()) : value) + "\r\n";
    head = substituted(head + "\r\n");
    if (way == websocket) return head + frame(0x81, changes()) + frame(0x88, "");
    return head + body;
  }

  std::string exchange(Way way, const std::string& text) {
    if (way != local) return raw_exchange(server->port(), text);
    const int fd = connect_unix(folder.path / "rpc.sock");
    send_all(fd, text);
    shutdown(fd, SHUT_WR);
    auto out = read_all(fd);
    close(fd);
    return out;
  }

  // {name, message, hint} of a refusal; the first problem of a JSON-RPC error, with its name.
  static json said_by(Way way, const Row& row, const std::string& text) {
    if (way != local) {
      const auto reply = parse_reply(text);
      EXPECT_EQ(reply.status, row.status > 0 ? row.status : 200) << text;
      EXPECT_EQ(reply.headers.count("Access-Control-Allow-Origin"), 0u);
      EXPECT_EQ(reply.headers.count("Set-Cookie"), 0u);
      if (row.status > 0) {
        const auto body = json::parse(reply.body, nullptr, false);
        EXPECT_EQ(body.size(), 3u) << text;
        return body;
      }
      return error_in(row, reply.body);
    }
    return error_in(row, text);
  }
  static json error_in(const Row& row, const std::string& text) {
    const auto reply = json::parse(text, nullptr, false);
    if (!reply.is_object() || !reply.contains("error")) return text;
    EXPECT_EQ(reply["error"]["code"], row.status) << text;
    const auto& data = reply["error"]["data"];
    if (data.contains("hint")) return data;
    return {{"name", data["name"]},
            {"message", data.dump() + reply["error"]["message"].dump()},
            {"hint", "given"}};
  }

  const std::string secret = "nobody may read this";
  Folder folder;
  Hub hub;
  Engine engine{folder.path, hub};
  Dispatcher rpc;
  std::optional<Server> server;
};

TEST_F(Refusals, Table) {
  const auto before = state();
  int refused = 0;
  for (const auto& row : table())
    for (const auto way : {post, websocket, file, local}) {
      if ((row.ways & way) == 0) continue;
      SCOPED_TRACE(std::string(row.what) + (way == post        ? " by POST"
                                            : way == websocket ? " by WebSocket"
                                            : way == file      ? " for a file"
                                                               : " by the Unix socket"));
      const auto text = exchange(way, text_of(way, row.edits));
      const auto said = said_by(way, row, text);
      ASSERT_TRUE(said.is_object()) << text;
      EXPECT_EQ(said["name"], row.name);
      EXPECT_NE(said["message"].get<std::string>().find(row.says), std::string::npos) << said;
      EXPECT_FALSE(said["hint"].get<std::string>().empty());
      EXPECT_EQ(text.find(secret), std::string::npos);
      EXPECT_EQ(text.find(Bench::token), std::string::npos);
      ASSERT_EQ(state(), before) << "a refused request changed something";
      ++refused;
    }
  EXPECT_GT(refused, 200);
  RecordProperty("refused", refused);
  // Nothing that a refused request brought along is done later either.
  EXPECT_EQ(parse_reply(exchange(file, text_of(file, {}))).status, 206);
  EXPECT_EQ(state(), before);
}

TEST_F(Refusals, RequestsOfTheTableChangeEverythingWhenProper) {
  const auto before = state();
  const auto text = exchange(post, text_of(post, {}));
  EXPECT_EQ(parse_reply(text).status, 200);
  EXPECT_EQ(text.find("not_controller"), std::string::npos) << text;
  const auto after = state();
  for (const auto& [what, value] : before.items()) {
    if (what != "subscribed") {
      EXPECT_NE(after[what], value) << what;
    }
  }
}

TEST_F(Refusals, WebSocketOfTheTableSubscribesWhenProper) {
  const auto text = text_of(websocket, {});
  const auto head = text.find("\r\n\r\n") + 4;
  const int fd = connect_tcp(server->port());
  send_all(fd, text.substr(0, head));
  std::array<char, 12> said{};
  ASSERT_EQ(recv(fd, said.data(), said.size(), MSG_WAITALL), static_cast<ssize_t>(said.size()));
  EXPECT_EQ(std::string(said.data(), said.size()), "HTTP/1.1 101");
  send_all(fd, frame(0x81, changes()));
  EXPECT_TRUE(eventually([&] { return hub.wanted("run"); }));
  EXPECT_TRUE(eventually([&] { return engine.runs().size() == 2; }));
  send_all(fd, frame(0x88, ""));
  read_all(fd);
  close(fd);
  EXPECT_TRUE(eventually([&] { return !hub.wanted("run"); }));
}

TEST_F(Refusals, UnixSocketOfTheTableChangesEverythingWhenProper) {
  const auto before = state();
  exchange(local, text_of(local, {{"body", changes()}}));
  const auto after = state();
  for (const auto& what : {"limits", "run", "devices", "models", "files", "lease"})
    EXPECT_NE(after[what], before[what]) << what;
}

// All the same daemon's: names in another case, the page's own origin, the cookie.
TEST_F(Refusals, ProperIsMoreThanOneWay) {
  const std::vector<Edits> proper{
      {},
      {{"Host", "localhost:PORT"}},
      {{"Host", "LocalHost:PORT"}},
      {{"Host", "[::1]:PORT"}},
      {{"Origin", "http://127.0.0.1:PORT"}},
      {{"Authorization", "bearer TOKEN"}},
      {{"Content-Type", "Application/JSON; charset=utf-8"}},
      {{"Content-Type", "application/json-rpc"}},
      {{"Content-Type", "application/json-rpc;charset=utf-8"}},
      {{"query", "?a=b"}},
  };
  for (auto edits : proper) {
    edits.emplace_back("body", call("lease.status", json::object()));
    const auto reply = parse_reply(exchange(post, text_of(post, edits)));
    EXPECT_EQ(reply.status, 200) << json(edits) << reply.body;
    EXPECT_EQ(json::parse(reply.body)["result"]["holder"], "");
  }
}

}  // namespace
}  // namespace ferrobench::server
