// The service described by itself: an OpenRPC document made from the tables that dispatch, so it cannot
// drift.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/rpc/dispatcher.h"
#include "server/rpc/hub.h"

namespace ferrobench::server {

// Methods with their parameters and results (units as "x-unit", role as "x-role"), the error table under
// components/errors, the topics under "x-notifications". `examples`: {method: parameters by name}.
nlohmann::json openrpc_document(const Dispatcher& dispatcher, const Hub& hub, const std::string& version,
                                const nlohmann::json& examples);

// Adds `rpc.discover`. Both tables must outlive the calls; they may still grow before the first one.
void add_discovery(Dispatcher& dispatcher, const Hub& hub, const std::string& version,
                   nlohmann::json examples = nlohmann::json::object());

}  // namespace ferrobench::server
