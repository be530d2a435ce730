#include "base/fields.h"

#include <algorithm>
#include <set>
#include <utility>

namespace ferrobench {
namespace fields_detail {

void check_number(double value, const FieldInfo& info, const std::string& path,
                  std::vector<Problem>& problems) {
  const bool low = info.exclusive_min ? value <= info.min : value < info.min;
  if (std::isfinite(value) && !low && value <= info.max) return;
  nlohmann::json allowed = nlohmann::json::object();
  if (std::isfinite(info.min)) allowed[info.exclusive_min ? "above" : "from"] = info.min;
  if (std::isfinite(info.max)) allowed["to"] = info.max;
  problems.push_back({.path = path,
                      .message = "is outside its range",
                      .given = value,
                      .allowed = allowed.empty() ? nlohmann::json("any finite number") : allowed,
                      .unit = std::string(info.unit)});
}

Problem wrong_type(const std::string& path, const nlohmann::json& given, std::string_view expected,
                   const FieldInfo& info) {
  // Whatever was given may be huge: a message quotes the start of it.
  const auto text = given.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  nlohmann::json shown = text.size() > 80 ? nlohmann::json(excerpt(text) + "...") : given;
  return {.path = path,
          .message = "must be " + std::string(expected),
          .given = std::move(shown),
          .unit = std::string(info.unit)};
}

Problem unknown_key(const std::string& path, const nlohmann::json& allowed) {
  std::vector<std::string> names;
  for (const auto& name : allowed) names.push_back(name.get<std::string>());
  const auto guess = nearest_name(path.substr(path.rfind('/') + 1), names);
  return {.path = path,
          .message = "is not a known key",
          .allowed = allowed,
          .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"};
}

std::string pointer(const std::string& parent, std::string_view key) {
  std::string out = parent + "/";
  for (const char c : key) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace fields_detail

nlohmann::json parse_json_text(std::string_view text, ErrorCode code, std::string_view what,
                               std::size_t max_bytes, int max_depth) {
  const std::string name(what);
  if (text.size() > max_bytes)
    throw Error(
        code, name + " is too long",
        Problem{.path = "", .message = "has too many bytes", .given = text.size(), .allowed = max_bytes});
  std::vector<std::set<std::string>> keys;
  const auto watch = [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
    using Event = nlohmann::json::parse_event_t;
    if (event == Event::object_start || event == Event::array_start) {
      if (depth >= max_depth)
        throw Error(code, name + " is nested deeper than " + std::to_string(max_depth) + " levels");
      keys.emplace_back();
    } else if (event == Event::object_end || event == Event::array_end) {
      keys.pop_back();
    } else if (event == Event::key && !keys.back().insert(parsed.get<std::string>()).second) {
      throw Error(code, name + " has the key \"" + parsed.get<std::string>() + "\" twice in one object");
    }
    return true;
  };
  try {
    return nlohmann::json::parse(text, watch);
  } catch (const nlohmann::json::parse_error& e) {
    const auto end = std::min<std::size_t>(e.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    throw Error(code, name + " is not JSON: it breaks at byte " + std::to_string(e.byte) + ", line " +
                          std::to_string(line));
  } catch (const nlohmann::json::exception& e) {
    throw Error(code, name + " is not JSON: " + e.what());
  }
}

std::string text_at(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

std::string excerpt(std::string_view text) {
  std::string out(text.substr(0, 80));
  for (char& c : out)
    if (c < ' ' || c > '~') c = '?';
  return out;
}

std::string nearest_name(std::string_view given, std::span<const std::string> allowed) {
  std::string best;
  // Of a short word little may be wrong, or every word is near to it.
  std::size_t best_distance = (given.size() < 4 ? 1 : std::max<std::size_t>(2, given.size() / 3)) + 1;
  for (const auto& name : allowed) {
    // Edits, of which two neighbours that changed places are one.
    std::vector<std::size_t> before, last, row(name.size() + 1);
    for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= given.size(); ++i) {
      before = std::exchange(last, row);
      row[0] = i;
      for (std::size_t j = 1; j < row.size(); ++j) {
        row[j] = std::min({last[j - 1] + (given[i - 1] == name[j - 1] ? 0 : 1), last[j] + 1, row[j - 1] + 1});
        const bool swapped = i > 1 && j > 1 && given[i - 1] == name[j - 2] && given[i - 2] == name[j - 1];
        if (swapped) row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = name;
    }
  }
  if (!best.empty() || given.size() < 3) return best;
  const auto begun =
      std::ranges::find_if(allowed, [&](const std::string& name) { return name.starts_with(given); });
  return begun == allowed.end() ? "" : *begun;
}

}  // namespace ferrobench
