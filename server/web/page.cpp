#include "server/web/page.h"

#include <array>
#include <string>
#include <utility>

// Made by ferrobench_embed().
namespace ferrobench::web {
std::optional<std::string_view> embedded(std::string_view name);
}

namespace ferrobench::server {
namespace {

constexpr std::array<std::pair<std::string_view, std::string_view>, 4> types{{
    {".html", "text/html; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".svg", "image/svg+xml"},
}};

}  // namespace

std::optional<Asset> page_asset(std::string_view path) {
  const auto file = "web" + std::string(path == "/" ? "/index.html" : path);
  const auto content = web::embedded(file);
  if (!content) return std::nullopt;
  for (const auto& [ending, type] : types)
    if (file.ends_with(ending)) return Asset{*content, type};
  return std::nullopt;
}

}  // namespace ferrobench::server
