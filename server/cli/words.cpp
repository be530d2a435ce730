#include "server/cli/words.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <sstream>
#include <string_view>

#include "base/fields.h"
#include "server/cli/cli.h"
#include "server/engine/request.h"

namespace ferrobench::cli {

using nlohmann::json;

namespace {

// What a hint may name. A method without a command of its own is called by `ferrobench call`.
constexpr std::array<std::pair<std::string_view, std::string_view>, 20> commands{
    {{"device.close", "call device.close"},
     {"device.list", "call device.list"},
     {"job.cancel", "call job.cancel"},
     {"job.list", "call job.list"},
     {"job.status", "call job.status"},
     {"lease.acquire", "call lease.acquire"},
     {"limits.get", "limits"},
     {"limits.set", "limits set"},
     {"model.effects", "effects"},
     {"model.fit", "fit"},
     {"model.list", "model list"},
     {"model.simulate", "simulate"},
     {"protocol.list", "protocol list"},
     {"queue.add", "queue add"},
     {"queue.list", "queue list"},
     {"recording.list", "list"},
     {"recording.recover", "recover"},
     {"rpc.discover", "call rpc.discover"},
     {"run.abort", "call run.abort"},
     {"run.status", "call run.status"}}};

const CLI::Option* given_option(const CLI::App& command, const std::string& name) {
  const auto* option = command.get_option_no_throw(name);
  return option != nullptr && option->count() > 0 ? option : nullptr;
}

// Whether a --set gives this key or something within it.
bool is_set(const CLI::App& command, const std::string& key) {
  const auto* option = given_option(command, "--set");
  return option != nullptr && std::ranges::any_of(option->results(), [&key](const std::string& setting) {
           return setting.starts_with(key + "=") || setting.starts_with(key + ".");
         });
}

std::string dotted(std::string pointer) {
  std::ranges::replace(pointer, '/', '.');
  return pointer;
}

// What the user named for the document that an error's pointers lead into; "" for a command that takes none,
// or more than one.
std::string document(ErrorCode code, const CLI::App& command) {
  std::vector<std::string> arguments;
  if (code == ErrorCode::bad_protocol || code == ErrorCode::limit_exceeded) arguments = {"PROTOCOL", "FILE"};
  if (code == ErrorCode::bad_model) arguments = {"--model", "MODEL"};
  if (code == ErrorCode::bad_recording) arguments = {"RECORDING"};
  for (const auto& name : arguments)
    if (const auto* option = given_option(command, name); option != nullptr && option->count() == 1)
      return option->results().front();
  return "";
}

// The parameter that a protocol has at this place; "" for a number of its own.
std::string parameter_at(const std::string& protocol, const std::string& path) try {
  const auto given = server::resolve_protocol(protocol_argument(protocol)).json();
  const auto& value = given.at(json::json_pointer(path));
  if (!value.is_string()) return "";
  const auto text = value.get<std::string>();
  const auto begin = text.find_first_not_of('-');
  return begin != std::string::npos && text[begin] == '$' ? text.substr(begin + 1) : "";
} catch (const std::exception&) {
  return "";  // what it was cannot be told twice: the place alone has to do
}

// A pointer into the parameters of a method: the option or argument of the same name.
std::string place_in_arguments(const std::string& path, const CLI::App& command) {
  const auto end = std::min(path.find('/', 1), path.size());
  const auto name = path.substr(1, end - 1), rest = path.substr(end);
  if (name == "set" && !rest.empty()) return "--set " + rest.substr(1);
  // A list of a method is an option that can be given again: "/tables" is --table.
  for (auto each : {name, name.substr(0, name.size() - (name.ends_with('s') ? 1 : 0))}) {
    std::ranges::replace(each, '_', '-');
    if (command.get_option_no_throw("--" + each) != nullptr) return "--" + each + rest;
    std::ranges::transform(each, each.begin(), [](unsigned char c) { return std::toupper(c); });
    if (command.get_option_no_throw(each) != nullptr) return each + rest;
  }
  // What is made of settings and of a file: a device's configuration, a map of columns.
  const auto key = dotted(path).substr(1);
  for (const auto& given : {"device." + key, key, name + "_Hz"})
    if (is_set(command, given)) return "--set " + given;
  for (const auto* file : {"--device-config", "--map"})
    if (const auto* from = given_option(command, file))
      return from->results().front() + ": " + (path.starts_with("/config/") ? path.substr(7) : path);
  return rest.empty() ? name : path;
}

std::string place(const std::string& path, ErrorCode code, const CLI::App& command) {
  if (!path.starts_with('/')) return path;
  if (code == ErrorCode::bad_model && is_set(command, "model" + dotted(path)))
    return "--set model" + dotted(path);
  const auto file = document(code, command);
  if (file.empty()) return place_in_arguments(path, command);
  auto where = file + ": " + path;
  if (code == ErrorCode::bad_model || code == ErrorCode::bad_recording) return where;
  const auto parameter = parameter_at(file, path);
  return !parameter.empty() && is_set(command, parameter) ? "--set " + parameter + " (" + where + ")" : where;
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
  return text;
}

std::string guess(const std::string& given, const std::vector<std::string>& names) {
  const auto nearest = nearest_name(given, names);
  return nearest.empty() ? "." : "; did you mean \"" + nearest + "\"?";
}

std::vector<std::string> commands_of(const CLI::App& app) {
  std::vector<std::string> names;
  const auto shown = [](const CLI::App* each) {
    return !each->get_name().empty() && !each->get_group().empty();  // others are hidden
  };
  for (const auto* sub : app.get_subcommands(shown)) names.push_back(sub->get_name());
  return names;
}

std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* option : app.get_options())
    for (const auto& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

std::string full_name(const CLI::App& app) {
  const auto* parent = app.get_parent();
  return parent == nullptr ? "ferrobench" : full_name(*parent) + " " + app.get_name();
}

}  // namespace

const CLI::App& chosen(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : chosen(*parsed.back());
}

std::span<const std::pair<std::string_view, std::string_view>> hinted_commands() {
  return commands;
}

std::string with_commands(const std::string& hint) {
  std::string out;
  for (std::size_t at = 0; at < hint.size();) {
    const auto part_of_word = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '_';
    };
    auto end = at;
    while (end < hint.size() && part_of_word(hint[end])) ++end;
    const auto word = hint.substr(at, end - at);
    const auto found = std::ranges::find(commands, std::string_view(word),
                                         &std::pair<std::string_view, std::string_view>::first);
    out += found == commands.end() ? word : "'ferrobench " + std::string(found->second) + "'";
    if (end < hint.size()) out += hint[end++];
    at = end;
  }
  return out;
}

Error in_users_words(const Error& error, const CLI::App& command) {
  if (command.get_name() == "call") return error;  // who calls a method speaks of methods
  auto problems = error.problems();
  for (auto& p : problems) {
    p.path = place(p.path, error.code(), command);
    p.hint = with_commands(p.hint);
  }
  // Where no problem leads into the document, the whole of it is meant.
  const auto file = document(error.code(), command);
  const bool whole = problems.empty() && !file.empty() && error.message().find(file) == std::string::npos;
  auto message = error.message();
  if (message == "Invalid params") message = entry(error.code()).meaning;  // what JSON-RPC says for it
  return {error.code(), whole ? file + ": " + message : message, std::move(problems)};
}

std::string usage_in_words(const CLI::ParseError& error, const CLI::App& app) {
  const auto& command = chosen(app);
  const auto& name = command.get_name();
  const auto help = "\n'" + full_name(command) + " --help' has all that it takes, with examples.";
  const auto subcommands = commands_of(command);
  const auto unknown = app.remaining(true);
  if (!unknown.empty()) {
    const auto& word = unknown.front();
    if (word.starts_with('-')) {
      auto options = options_of(command);
      for (const auto& common : options_of(app)) options.push_back(common);
      return (name.empty() ? "there is" : name + " has") + " no option " + word +
             guess(word.substr(0, word.find('=')), options) + help;
    }
    if (subcommands.empty()) return name + " takes no further \"" + excerpt(word) + "\"." + help;
    return "there is no command \"" + excerpt(word) + "\"" + guess(word, subcommands) +
           "\nCommands: " + join(subcommands) + help;
  }
  if (!subcommands.empty() && dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    return (name.empty() ? "a" : name + ": a") + " command is wanted: " + join(subcommands) + help;
  return error.what() + help;
}

CLI::Validator one_of(std::vector<std::string> names) {
  return {[names](std::string& given) {
            if (std::ranges::find(names, given) != names.end()) return std::string{};
            return "\"" + excerpt(given) + "\" is not known" + guess(given, names) +
                   " Allowed: " + join(names);
          },
          "{" + CLI::detail::join(names, ",") + "}"};
}

CLI::Validator number_from(double low, double high) {
  std::ostringstream range;
  range << "a number ";
  std::isfinite(high) ? range << "from " << low << " to " << high : range << "of at least " << low;
  return {[low, high, wanted = range.str()](std::string& given) {
            double value = 0;
            if (CLI::detail::lexical_cast(given, value) && value >= low && value <= high)
              return std::string{};
            return "\"" + excerpt(given) + "\" is not " + wanted;
          },
          ""};
}

}  // namespace ferrobench::cli
