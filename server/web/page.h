// The page as built into the program: index.html, its styles and scripts, and uPlot.
#pragma once

#include <optional>
#include <string_view>

#include "server/net/server.h"

namespace ferrobench::server {

// The file at a path of the daemon's address ("/", "/app.js"), or nothing.
std::optional<Asset> page_asset(std::string_view path);

}  // namespace ferrobench::server
