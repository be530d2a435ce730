// Takes an admitted HTTP connection over as a WebSocket. Internal: pulls in Beast.
#pragma once

#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <memory>

#include "server/net/service.h"

namespace ferrobench::server {

using PlainStream = boost::beast::tcp_stream;
using TlsStream = boost::beast::ssl_stream<PlainStream>;

void start_websocket(Service& service, PlainStream stream,
                     boost::beast::http::request<boost::beast::http::string_body> request,
                     std::shared_ptr<CallContext> context);
void start_websocket(Service& service, TlsStream stream,
                     boost::beast::http::request<boost::beast::http::string_body> request,
                     std::shared_ptr<CallContext> context);

}  // namespace ferrobench::server
