// Takes an admitted HTTP connection over as a WebSocket. Internal: pulls in Beast.
#pragma once

#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>

#include "server/net/service.h"

namespace ferrobench::server {

void start_websocket(Service& service, boost::beast::tcp_stream stream,
                     boost::beast::http::request<boost::beast::http::string_body> request,
                     std::shared_ptr<CallContext> context);

}  // namespace ferrobench::server
