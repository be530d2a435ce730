// JSON-RPC 2.0 over a table of methods: text in, text out, no networking.
//
// Parameters are named; an array is taken by position in the order of Method::parameters. Every failure is a
// JSON-RPC error whose `data` is {name, problems: [{path, message, given, allowed, unit, hint}]}; `name` is
// the stable part.
//
// The table is filled before the first call; handle() and call() may then run on any number of threads.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "server/rpc/method.h"

namespace ferrobench::server {

struct DispatchLimits {
  std::size_t max_bytes = 4u << 20;  // of one request or batch
  int max_depth = 40;                // of nesting, the batch and the request included
  std::size_t max_batch = 100;       // requests in one batch
};

// A call that is over, for whoever keeps account of them.
struct Call {
  std::string_view name;
  const Method* method;  // null: no such method, or no request at all
  const nlohmann::json& params;
  const CallContext& caller;
  std::string_view outcome;  // "ok", or the name of the error
  std::chrono::nanoseconds time;
};

// What a text asks for.
struct Asked {
  Lane lane = Lane::usual;  // of the slowest of its requests
  bool stop = false;        // whether something in it stops the bench
  bool alone = true;        // and nothing else is in it
  bool views = false;       // whether it asks for nothing but what is heavy
};
enum class Part { all, stops, rest };  // of a batch

class Dispatcher {
 public:
  // Runs before every method of Role::control; throws Error(not_controller) to refuse the caller.
  using Gate = std::function<void(const Method&, const CallContext&)>;

  explicit Dispatcher(DispatchLimits limits = {});

  template <class P, class F>
  void add(MethodInfo info, F handler) {
    add(make_method<P>(std::move(info), std::move(handler)));
  }
  void add(Method method);  // a second method of the same name is a programmer's error
  void set_gate(Gate gate) { gate_ = std::move(gate); }
  // Is told of every call that comes as text, on the thread that made it.
  using Observer = std::function<void(const Call&)>;
  void set_observer(Observer observer) { observer_ = std::move(observer); }

  // Only looks at the names of the methods, and at those of no long text: what stops the bench is short.
  Asked look(std::string_view text) const noexcept;
  // The reply, or nothing if the text held notifications only. Does not throw.
  std::optional<std::string> handle(std::string_view text, CallContext& context,
                                    Part part = Part::all) const noexcept;
  // One call in-process: the result, or Error. Parameters may be null (none), an object or an array.
  nlohmann::json call(std::string_view name, const nlohmann::json& params, CallContext& context) const;

  // Errors that a method gave though its row does not list them, as "method: error"; of this whole process.
  static std::vector<std::string> unlisted_errors();

  const std::map<std::string, Method, std::less<>>& methods() const { return methods_; }
  const DispatchLimits& limits() const { return limits_; }

 private:
  const Method* find(std::string_view name) const;
  std::string nearest(std::string_view name) const;
  nlohmann::json invoke(const Method& method, const nlohmann::json& params, CallContext& context) const;
  void report(Call call, const nlohmann::json& reply) const;
  std::optional<nlohmann::json> answer(const nlohmann::json& request, CallContext& context) const;
  std::optional<std::string> answer_text(std::string_view text, CallContext& context, Part part) const;
  bool stops(const nlohmann::json& request) const;

  DispatchLimits limits_;
  Gate gate_;
  Observer observer_;
  std::map<std::string, Method, std::less<>> methods_;
};

}  // namespace ferrobench::server
