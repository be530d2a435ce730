#include <algorithm>

#include "base/fields.h"
#include "protocols/protocol.h"

namespace ferrobench::protocols {

// From the generated source that holds protocols/library/.
std::optional<std::string_view> embedded(std::string_view name);
std::vector<std::string_view> embedded_names();

namespace {
constexpr std::string_view folder = "library/", ending = ".json";
}

std::vector<std::string> library_names() {
  std::vector<std::string> names;
  for (auto name : embedded_names()) {
    name.remove_prefix(folder.size());
    name.remove_suffix(ending.size());
    names.emplace_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

Protocol library_protocol(std::string_view name) {
  const auto text = embedded(std::string(folder) + std::string(name) + std::string(ending));
  if (text) return Protocol::from_text(*text);
  const auto names = library_names();
  const auto guess = nearest_name(name.substr(0, 80), names);
  throw Error(ErrorCode::not_found, "no protocol has this name",
              Problem{.message = "is not the name of a shipped protocol",
                      .given = excerpt(name),
                      .allowed = names,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

}  // namespace ferrobench::protocols
