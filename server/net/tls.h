// The certificate and key of the daemon. Internal: for the few sources that do the networking.
#pragma once

#include <memory>

#include "server/net/options.h"

namespace boost::asio::ssl {
class context;
}

namespace ferrobench::server {

// TLS 1.2 or later with the certificate and key of the options; null if they name none. Error(io_error) if
// they cannot be read, do not belong together, or others may read the key.
std::shared_ptr<boost::asio::ssl::context> make_tls(const ServerOptions& options);

}  // namespace ferrobench::server
