// The door with TLS: the same methods over HTTPS and WSS, and nothing in plain text.
#include <gtest/gtest.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <boost/asio/read.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

#include "engine_bench.h"
#include "net_bench.h"
#include "server/net/client.h"

namespace ferrobench::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace ssl = asio::ssl;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using nlohmann::json;

// A certificate for 127.0.0.1 that signs itself, and its key.
void make_certificate(const std::string& certificate_file, const std::string& key_file) {
  const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(EVP_EC_gen("P-256"), EVP_PKEY_free);
  const std::unique_ptr<X509, void (*)(X509*)> certificate(X509_new(), X509_free);
  X509* x = certificate.get();
  X509_set_version(x, 2);
  ASN1_INTEGER_set(X509_get_serialNumber(x), 1);
  X509_gmtime_adj(X509_getm_notBefore(x), -3600);
  X509_gmtime_adj(X509_getm_notAfter(x), 3600);
  X509_set_pubkey(x, key.get());
  X509_NAME* name = X509_get_subject_name(x);
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("bench"), -1,
                             -1, 0);
  X509_set_issuer_name(x, name);
  X509_EXTENSION* names =
      X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, "IP:127.0.0.1,DNS:bench.lab");
  X509_add_ext(x, names, -1);
  X509_EXTENSION_free(names);
  ASSERT_GT(X509_sign(x, key.get(), EVP_sha256()), 0);
  FILE* out = std::fopen(certificate_file.c_str(), "w");
  PEM_write_X509(out, x);
  std::fclose(out);
  out = std::fopen(key_file.c_str(), "w");
  PEM_write_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
  std::fclose(out);
  chmod(key_file.c_str(), 0600);
}

class Tls : public testing::Test {
 protected:
  Tls() {
    make_certificate(options.tls_certificate, options.tls_key);
    client.load_verify_file(options.tls_certificate);
    client.set_verify_mode(ssl::verify_peer);
    client.set_verify_callback(ssl::host_name_verification("127.0.0.1"));
  }

  static ServerOptions in(const std::filesystem::path& folder) {
    ServerOptions out;
    out.tls_certificate = folder / "bench.pem";
    out.tls_key = folder / "bench.key";
    return out;
  }

  // As raw_exchange(), through TLS.
  Reply https(const Bench& bench, const std::string& text) {
    ssl::stream<tcp::socket> stream(io, client);
    stream.next_layer().connect({asio::ip::address_v4::loopback(), bench.port()});
    stream.handshake(ssl::stream_base::client);
    asio::write(stream, asio::buffer(text));
    std::string out;
    boost::system::error_code ec;
    asio::read(stream, asio::dynamic_buffer(out), ec);
    EXPECT_EQ(ec, asio::error::eof) << "the daemon did not say that this is all: " << ec.message();
    return parse_reply(out);
  }
  std::string count(const Bench& bench, const std::string& fields = "") const {
    const std::string body = R"({"jsonrpc":"2.0","method":"count","id":1})";
    return "POST /rpc HTTP/1.1\r\nHost: " + bench.host() + "\r\nConnection: close\r\nAuthorization: Bearer " +
           Bench::token + "\r\nContent-Type: application/json\r\n" + fields +
           "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
  }

  Folder folder;
  ServerOptions options = in(folder.path);
  asio::io_context io;
  ssl::context client{ssl::context::tls_client};
};

TEST_F(Tls, CallsByHttps) {
  Bench bench(options);
  const auto reply = https(bench, count(bench, "Origin: https://" + bench.host() + "\r\n"));
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(json::parse(reply.body)["result"], 1);
  EXPECT_EQ(https(bench, count(bench, "Origin: http://" + bench.host() + "\r\n")).status, 403);
  EXPECT_EQ(https(bench, "GET / HTTP/1.1\r\nHost: " + bench.host() + "\r\n\r\n").status, 401);
  auto signed_in = https(bench, "GET /?token=" + Bench::token + " HTTP/1.1\r\nHost: " + bench.host() +
                                    "\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(signed_in.status, 303);
  EXPECT_TRUE(signed_in.headers["Set-Cookie"].ends_with("; Secure"));
  const auto file =
      https(bench, "GET /recordings/loop.h5 HTTP/1.1\r\nHost: " + bench.host() +
                       "\r\nConnection: close\r\nAuthorization: Bearer " + Bench::token + "\r\n\r\n");
  EXPECT_TRUE(file.body == bench.recording);
  EXPECT_EQ(https(bench, count(bench, "X: " + std::string(200'000, 'x') + "\r\n")).status, 431)
      << "the reply reaches who still speaks";
  EXPECT_EQ(bench.counted, 1);
}

TEST_F(Tls, CallsByWebSocket) {
  Bench bench(options);
  websocket::stream<beast::ssl_stream<tcp::socket>> socket(io, client);
  beast::get_lowest_layer(socket).connect({asio::ip::address_v4::loopback(), bench.port()});
  socket.next_layer().handshake(ssl::stream_base::client);
  socket.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
    request.set(beast::http::field::authorization, "Bearer " + Bench::token);
    request.set(beast::http::field::origin, "https://" + bench.host());
  }));
  socket.handshake(bench.host(), "/rpc");
  const auto hear = [&] {
    beast::flat_buffer buffer;
    socket.read(buffer);
    return json::parse(beast::buffers_to_string(buffer.data()));
  };
  socket.write(asio::buffer(std::string(R"({"jsonrpc":"2.0","method":"who","id":1})")));
  EXPECT_TRUE(hear()["result"][0].get<std::string>().starts_with("websocket with TLS 127.0.0.1 port "));
  socket.write(
      asio::buffer(std::string(R"({"jsonrpc":"2.0","method":"subscribe","params":{"topic":"run"},"id":2})")));
  EXPECT_EQ(hear()["id"], 2);
  bench.hub.publish("run", {{"state", "running"}});
  EXPECT_EQ(hear()["params"]["state"], "running");
  socket.close(websocket::close_code::normal);
  EXPECT_TRUE(eventually([&] { return bench.gone == 1; }));
}

TEST_F(Tls, CallsFromTheCommandLineOfAnotherMachine) {
  setenv("no_proxy", "127.0.0.1", 1);
  Bench bench(options);
  const Remote remote{"https://" + bench.host() + "/", options.tls_certificate, Bench::token};
  EXPECT_EQ(call_remote(remote, "echo", {{"value", {1, "two\nlines"}}}), (json{1, "two\nlines"}));
  EXPECT_EQ(code_of([&] { call_remote(remote, "ecko", json::object()); }), ErrorCode::not_found);
  auto changed = remote;
  changed.lease = "1234";
  EXPECT_EQ(call_remote(changed, "who", json::object())[1], "1234");
  changed = remote;
  changed.token = std::string(64, '0');
  EXPECT_EQ(code_of([&] { call_remote(changed, "count", json::object()); }), ErrorCode::unauthorized);
  changed = remote;
  changed.ca = "";
  EXPECT_EQ(code_of([&] { call_remote(changed, "count", json::object()); }), ErrorCode::io_error)
      << "not trusted";
  changed = remote;
  changed.url = "http://" + bench.host();
  EXPECT_EQ(code_of([&] { call_remote(changed, "count", json::object()); }), ErrorCode::invalid_params);
  EXPECT_EQ(bench.counted, 0);
}

TEST_F(Tls, PlainTextIsRefusedAndChangesNothing) {
  Bench bench(options);
  const auto reply = http(bench, {});
  EXPECT_EQ(reply.status, 400);
  const auto body = json::parse(reply.body);
  EXPECT_EQ(body["name"], "unauthorized");
  EXPECT_NE(body["message"].get<std::string>().find("TLS"), std::string::npos);
  EXPECT_NE(body["hint"].get<std::string>().find("https://"), std::string::npos);
  EXPECT_EQ(bench.counted, 0);
}

TEST_F(Tls, OldVersionsAreRefused) {
  Bench bench(options);
  const auto shakes_hands = [&](int newest) {
    ssl::context old(ssl::context::tls_client);
    SSL_CTX_set_cipher_list(old.native_handle(), "ALL:@SECLEVEL=0");
    SSL_CTX_set_min_proto_version(old.native_handle(), TLS1_VERSION);
    SSL_CTX_set_max_proto_version(old.native_handle(), newest);
    ssl::stream<tcp::socket> stream(io, old);
    stream.next_layer().connect({asio::ip::address_v4::loopback(), bench.port()});
    boost::system::error_code ec;
    stream.handshake(ssl::stream_base::client, ec);
    return !ec;
  };
  EXPECT_FALSE(shakes_hands(TLS1_VERSION));
  EXPECT_FALSE(shakes_hands(TLS1_1_VERSION));
  EXPECT_TRUE(shakes_hands(TLS1_2_VERSION));
  EXPECT_TRUE(shakes_hands(TLS1_3_VERSION));
}

TEST_F(Tls, SlowHandshakesAreGivenUp) {
  options.header_timeout = std::chrono::milliseconds(200);
  options.max_connections = 1;
  Bench bench(options);
  for (const std::string begin :
       {"", "\x16", "\x16\x03\x01\x02", "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"}) {
    EXPECT_EQ(raw_exchange(bench.port(), begin), "");
    EXPECT_EQ(https(bench, count(bench)).status, 200);
  }
  EXPECT_EQ(parse_reply(raw_exchange(bench.port(), "\x16garbage that is no handshake")).status, 400);
}

TEST_F(Tls, BeyondLoopbackItNeedsTls) {
  Bench bench([&] {
    auto all = options;
    all.address = "0.0.0.0";
    return all;
  }());
  EXPECT_EQ(https(bench, count(bench)).status, 200);
  ServerOptions plain;
  plain.address = "0.0.0.0";
  EXPECT_EQ(code_of([&] { Bench refused(plain); }), ErrorCode::invalid_params);
}

TEST(Origin, IsAnAddressThatCanBeOpened) {
  ServerOptions o;
  EXPECT_EQ(o.origin(8377), "http://127.0.0.1:8377");
  o.tls_certificate = "bench.pem";
  o.address = "0.0.0.0";
  EXPECT_EQ(o.origin(80), "https://127.0.0.1:80") << "no name is known that others could use";
  o.extra_hosts = {"bench.lab", "bench"};
  EXPECT_EQ(o.origin(8377), "https://bench.lab:8377");
  o.address = "192.168.1.5";
  EXPECT_EQ(o.origin(8377), "https://bench.lab:8377");
  o.address = "127.0.0.1";
  EXPECT_EQ(o.origin(8377), "https://127.0.0.1:8377") << "others come by a proxy of their own";
  o.address = "::1";
  EXPECT_EQ(o.origin(8377), "https://[::1]:8377");
}

TEST_F(Tls, FilesThatCannotBeUsedAreErrors) {
  const auto code = [&](const std::string& certificate, const std::string& key) {
    auto changed = options;
    changed.tls_certificate = certificate;
    changed.tls_key = key;
    return code_of([&] { Bench refused(changed); });
  };
  const auto other = (folder.path / "other.key").string();
  make_certificate(folder.path / "other.pem", other);
  EXPECT_EQ(code(options.tls_certificate, other), ErrorCode::io_error) << "of another certificate";
  EXPECT_EQ(code(options.tls_key, options.tls_key), ErrorCode::io_error) << "no certificate";
  EXPECT_EQ(code(options.tls_certificate, "/no/such/file"), ErrorCode::io_error);
  chmod(options.tls_key.c_str(), 0644);
  EXPECT_EQ(code(options.tls_certificate, options.tls_key), ErrorCode::io_error) << "for everybody to read";
  EXPECT_EQ(code("", options.tls_key), ErrorCode::invalid_params);
}

}  // namespace
}  // namespace ferrobench::server
