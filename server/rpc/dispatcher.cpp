#include "server/rpc/dispatcher.h"

#include <spdlog/spdlog.h>

#include <cassert>
#include <mutex>
#include <set>
#include <vector>

namespace ferrobench::server {
namespace {

using nlohmann::json;

constexpr int parse_error = -32700;
constexpr int invalid_request = -32600;
constexpr int method_not_found = -32601;
constexpr int internal_error = -32603;

json error_reply(int code, std::string_view message, json data, json id) {
  return {{"jsonrpc", "2.0"},
          {"error", {{"code", code}, {"message", message}, {"data", std::move(data)}}},
          {"id", std::move(id)}};
}

json one_problem(std::string_view name, const Problem& problem) {
  return {{"name", name}, {"problems", json::array({to_json(problem)})}};
}

json refuse_request(const Problem& problem, json id) {
  return error_reply(invalid_request, "Invalid Request", one_problem("invalid_request", problem),
                     std::move(id));
}

bool may_be_id(const json& id) {
  return id.is_string() || id.is_number() || id.is_null();
}

// What is wrong with the form of a request, if anything.
std::optional<Problem> form_problem(const json& request) {
  if (!request.is_object())
    return Problem{.path = "", .message = "must be an object with jsonrpc, method, params and id"};
  const auto version = request.find("jsonrpc");
  if (version == request.end() || *version != "2.0")
    return Problem{.path = "/jsonrpc", .message = "must be there and be the text 2.0", .allowed = "2.0"};
  const auto method = request.find("method");
  if (method == request.end() || !method->is_string())
    return Problem{.path = "/method", .message = "must be there and be a text"};
  const auto params = request.find("params");
  if (params != request.end() && !params->is_structured())
    return Problem{.path = "/params",
                   .message = "must be an object (by name) or an array (by position)",
                   .hint = "leave it out if the method takes none"};
  const auto id = request.find("id");
  if (id != request.end() && !may_be_id(*id))
    return Problem{.path = "/id", .message = "must be a text, a number or null"};
  return std::nullopt;
}

Error too_many_views() {
  return {ErrorCode::busy, "too many others wait for recordings and reports",
          Problem{.hint = "ask again in a moment; run.abort and run.status are answered meanwhile"}};
}

json by_name(const Method& method, const json& params) {
  if (params.is_null()) return json::object();
  if (!params.is_array()) return params;
  if (params.size() > method.parameters.size())
    throw Error(ErrorCode::invalid_params, "Invalid params",
                Problem{.path = "",
                        .message = "has more parameters than the method takes",
                        .given = params.size(),
                        .allowed = method.parameters.size()});
  json named = json::object();
  for (std::size_t i = 0; i < params.size(); ++i) named[method.parameters[i].name] = params[i];
  return named;
}

// The methods that a request or a batch names, without reading what else is in it.
class MethodNames final : public nlohmann::json_sax<json> {
 public:
  explicit MethodNames(std::function<void(const std::string&)> found) : found_(std::move(found)) {}
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool string(string_t& text) override {
    if (is_method_) found_(text);
    return true;
  }
  bool start_object(std::size_t) override { return ++depth_, true; }
  bool end_object() override { return --depth_, true; }
  bool start_array(std::size_t) override {
    batch_ = batch_ || depth_ == 0;
    return ++depth_, true;
  }
  bool end_array() override { return --depth_, true; }
  bool key(string_t& name) override {
    is_method_ = depth_ == (batch_ ? 2 : 1) && name == "method";
    return true;
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  std::function<void(const std::string&)> found_;
  int depth_ = 0;
  bool batch_ = false, is_method_ = false;
};

// File names and the like may not be UTF-8; the reply always is.
std::string text_of(const json& reply) {
  return reply.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

Dispatcher::Dispatcher(DispatchLimits limits) : limits_(limits) {}

void Dispatcher::add(Method method) {
  auto name = method.info.name;
  [[maybe_unused]] const bool added = methods_.emplace(std::move(name), std::move(method)).second;
  assert(added);
}

const Method* Dispatcher::find(std::string_view name) const {
  const auto found = methods_.find(name);
  return found == methods_.end() ? nullptr : &found->second;
}

std::string Dispatcher::nearest(std::string_view name) const {
  std::vector<std::string> names;
  for (const auto& [known, method] : methods_) names.push_back(known);
  // The distance costs the product of both lengths: no client needs a guess for a name of a megabyte.
  const auto guess = nearest_name(name.substr(0, 64), names);
  return guess.empty() ? "rpc.discover lists the methods" : "did you mean \"" + guess + "\"?";
}

namespace {

std::mutex unlisted_lock;
std::set<std::string> unlisted;

}  // namespace

std::vector<std::string> Dispatcher::unlisted_errors() {
  const std::scoped_lock lock(unlisted_lock);
  return {unlisted.begin(), unlisted.end()};
}

json Dispatcher::invoke(const Method& method, const json& params, CallContext& context) const {
  try {
    if (context.crowded && method.info.lane == Lane::heavy) throw too_many_views();
    if (method.info.role == Role::control && gate_) gate_(method, context);
    return method.call(by_name(method, params), context);
  } catch (const Error& e) {
    if (!method.may_fail_with(e.code())) {
      const std::scoped_lock lock(unlisted_lock);
      const auto what = method.info.name + ": " + std::string(entry(e.code()).name);
      if (unlisted.insert(what).second) spdlog::warn("an error that the method does not list: {}", what);
    }
    throw;
  }
}

json Dispatcher::call(std::string_view name, const json& params, CallContext& context) const {
  const Method* method = find(name);
  if (method == nullptr)
    throw Error(
        ErrorCode::not_found, "there is no method " + std::string(name),
        Problem{.path = "/method", .message = "is not in the table", .given = name, .hint = nearest(name)});
  return invoke(*method, params, context);
}

void Dispatcher::report(Call call, const json& reply) const {
  if (!observer_) return;
  call.outcome = "ok";
  if (const auto error = reply.find("error"); error != reply.end())
    call.outcome = (*error)["data"]["name"].get_ref<const std::string&>();
  observer_(call);
}

std::optional<json> Dispatcher::answer(const json& request, CallContext& context) const {
  const auto id_at = request.is_object() ? request.find("id") : request.end();
  const bool has_id = request.is_object() && id_at != request.end();
  json id = has_id && may_be_id(*id_at) ? *id_at : json(nullptr);
  if (const auto problem = form_problem(request)) {
    auto reply = refuse_request(*problem, std::move(id));
    report({{}, nullptr, nullptr, context, {}, {}}, reply);
    return reply;
  }

  const auto begin = std::chrono::steady_clock::now();
  const auto& name = request["method"].get_ref<const std::string&>();
  const auto params = request.value("params", json(nullptr));
  const Method* method = find(name);
  json reply;
  if (method == nullptr) {
    reply = error_reply(method_not_found, "Method not found",
                        one_problem("method_not_found", {.path = "/method",
                                                         .message = "is not in the table",
                                                         .given = name.substr(0, 64),
                                                         .hint = nearest(name)}),
                        std::move(id));
  } else {
    try {
      auto result = invoke(*method, params, context);
      reply = {{"jsonrpc", "2.0"}, {"result", std::move(result)}, {"id", std::move(id)}};
    } catch (const Error& e) {
      reply = error_reply(entry(e.code()).rpc_code, e.message(), e.data(), std::move(id));
    } catch (const std::exception& e) {
      spdlog::error("{} called by {} failed: {}", name, context.client, e.what());
      reply =
          error_reply(internal_error, "Internal error",
                      one_problem("internal", {.path = "", .message = "the daemon's log says what happened"}),
                      std::move(id));
    }
  }
  report({name, method, params, context, {}, std::chrono::steady_clock::now() - begin}, reply);
  if (!has_id) return std::nullopt;
  return reply;
}

Asked Dispatcher::look(std::string_view text) const noexcept {
  constexpr std::size_t most_looked_at = 64u << 10;
  if (text.size() > most_looked_at) return {.lane = Lane::heavy};
  std::size_t count = 0, urgent = 0, heavy = 0;
  Asked out;
  try {
    MethodNames names([&](const std::string& name) {
      ++count;
      const auto* method = find(name);
      if (method == nullptr) return;
      urgent += method->info.lane == Lane::urgent ? 1 : 0;
      out.stop = out.stop || method->info.role == Role::stop;
      out.alone = out.alone && method->info.role == Role::stop;
      if (method->info.lane != Lane::heavy) return;
      ++heavy;
      out.lane = Lane::heavy;
    });
    if (!json::sax_parse(text, &names) || count > limits_.max_batch) return {};  // to be refused
  } catch (...) {
    return {};
  }
  if (count > 0 && urgent == count) out.lane = Lane::urgent;
  out.views = count > 0 && heavy == count;
  return out;
}

bool Dispatcher::stops(const json& request) const {
  if (!request.is_object()) return false;
  const auto* method = find(text_at(request, "method"));
  return method != nullptr && method->info.role == Role::stop;
}

std::optional<std::string> Dispatcher::answer_text(std::string_view text, CallContext& context,
                                                   Part part) const {
  json parsed;
  try {
    parsed =
        parse_json_text(text, ErrorCode::invalid_params, "the request", limits_.max_bytes, limits_.max_depth);
  } catch (const Error& e) {
    auto data = one_problem("parse_error", {.path = "", .message = e.what()});
    const auto reply = error_reply(parse_error, "Parse error", std::move(data), nullptr);
    report({{}, nullptr, nullptr, context, {}, {}}, reply);
    return text_of(reply);
  }
  if (!parsed.is_array()) {
    const auto reply = answer(parsed, context);
    return reply ? std::optional(text_of(*reply)) : std::nullopt;
  }
  if (parsed.empty() || parsed.size() > limits_.max_batch) {
    const auto reply =
        refuse_request({.path = "",
                        .message = "a batch has at least one request and at most the number allowed",
                        .given = parsed.size(),
                        .allowed = limits_.max_batch},
                       nullptr);
    report({{}, nullptr, nullptr, context, {}, {}}, reply);
    return text_of(reply);
  }
  json replies = json::array();
  for (const auto& request : parsed) {
    if (part != Part::all && stops(request) != (part == Part::stops)) continue;
    if (auto reply = answer(request, context)) replies.push_back(std::move(*reply));
  }
  return replies.empty() ? std::nullopt : std::optional(text_of(replies));
}

std::optional<std::string> Dispatcher::handle(std::string_view text, CallContext& context,
                                              Part part) const noexcept {
  try {
    return answer_text(text, context, part);
  } catch (...) {
    return R"({"jsonrpc":"2.0","error":{"code":-32603,"message":"Internal error"},"id":null})";
  }
}

}  // namespace ferrobench::server
