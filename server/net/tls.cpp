#include "server/net/tls.h"

#include <sys/stat.h>

#include <boost/asio/ssl/context.hpp>
#include <cerrno>
#include <system_error>

namespace ferrobench::server {
namespace {

namespace ssl = boost::asio::ssl;

[[noreturn]] void fail_tls(const char* option, const std::string& file, const std::string& why,
                           const std::string& hint) {
  throw Error(ErrorCode::io_error, "TLS cannot be set up",
              Problem{.path = option, .message = why, .given = file, .hint = hint});
}

void demand_private(const std::string& key) {
  struct stat info {};
  if (stat(key.c_str(), &info) != 0)
    fail_tls("/tls_key", key, std::generic_category().message(errno), "name the file of the private key");
  if ((info.st_mode & 007) != 0)
    fail_tls("/tls_key", key, "everybody may read it", "chmod 600 it; a new key would be better");
}

}  // namespace

std::shared_ptr<ssl::context> make_tls(const ServerOptions& options) {
  if (options.tls_certificate.empty()) return nullptr;
  demand_private(options.tls_key);
  auto context = std::make_shared<ssl::context>(ssl::context::tls_server);
  SSL_CTX_set_min_proto_version(context->native_handle(), TLS1_2_VERSION);
  SSL_CTX_set_options(context->native_handle(), SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  boost::system::error_code failure;
  context->use_certificate_chain_file(options.tls_certificate, failure);
  if (failure)
    fail_tls("/tls_certificate", options.tls_certificate, failure.message(),
             "PEM: the daemon's certificate first, then those that signed it");
  context->use_private_key_file(options.tls_key, ssl::context::pem, failure);
  if (failure)
    fail_tls("/tls_key", options.tls_key, failure.message(), "PEM, without passphrase, of this certificate");
  return context;
}

}  // namespace ferrobench::server
