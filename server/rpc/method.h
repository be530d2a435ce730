// One row of the method table. Parameters are read, checked and documented from the describe() of their
// struct.
#pragma once

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/fields.h"
#include "server/rpc/context.h"

namespace ferrobench::server {

struct MethodInfo {
  std::string name;  // "area.verb"
  std::string doc;   // one sentence
  Role role = Role::view;
  Lane lane = Lane::usual;  // what stops is always urgent
  bool audited = false;     // kept account of although it only views; what controls or stops always is
  // What it may fail with, beside what follows from the row: invalid_params where it takes parameters,
  // not_controller where it controls, busy where it is heavy.
  std::vector<ErrorCode> errors = {};
  nlohmann::json result_schema =
      nullptr;  // only for a handler that returns raw JSON; otherwise made from its type
};

struct Parameter {
  std::string name;
  bool required = false;
  nlohmann::json schema;
};

struct Method {
  MethodInfo info;
  std::vector<Parameter>
      parameters;  // required ones first, else as described; the order of by-position calls
  std::function<nlohmann::json(const nlohmann::json& named, CallContext&)> call;

  bool may_fail_with(ErrorCode code) const {
    return std::ranges::find(info.errors, code) != info.errors.end();
  }
};

// For methods without parameters.
struct NoParams {};
template <class Visitor>
void describe(Visitor&, NoParams&) {}

namespace method_detail {

struct ParameterLister {
  std::vector<Parameter>& out;
  template <class T>
  void operator()(std::string_view name, T& value, const FieldInfo& info) {
    fields_detail::SchemaMaker maker;
    maker(name, value, info);
    out.push_back({std::string(name), info.required, std::move(maker.properties.front())});
  }
};

template <class P, class F>
decltype(auto) invoke(F& handler, const P& params, CallContext& context) {
  if constexpr (std::is_invocable_v<F&, const P&, CallContext&>) {
    return handler(params, context);
  } else {
    return handler(params);
  }
}

}  // namespace method_detail

// handler: R(const P&, CallContext&) or R(const P&). R is a described type, raw JSON, or void (result null).
template <class P, class F>
Method make_method(MethodInfo info, F handler) {
  using R = std::decay_t<decltype(method_detail::invoke<P>(handler, std::declval<const P&>(),
                                                           std::declval<CallContext&>()))>;
  Method method;
  if (info.role == Role::stop) info.lane = Lane::urgent;
  if constexpr (std::is_void_v<R>) {
    info.result_schema = {{"type", "null"}};
  } else if constexpr (!std::is_same_v<R, nlohmann::json>) {
    info.result_schema = json_schema<R>();
  } else if (info.result_schema.is_null()) {
    info.result_schema = nlohmann::json::object();
  }
  method.info = std::move(info);
  P sample{};
  method_detail::ParameterLister lister{method.parameters};
  describe(lister, sample);
  std::stable_partition(method.parameters.begin(), method.parameters.end(),
                        [](const Parameter& p) { return p.required; });
  auto& errors = method.info.errors;
  errors.push_back(ErrorCode::invalid_params);  // at least for a parameter that there is not
  if (method.info.role == Role::control) errors.push_back(ErrorCode::not_controller);
  if (method.info.lane == Lane::heavy) errors.push_back(ErrorCode::busy);
  std::ranges::sort(errors);
  errors.erase(std::unique(errors.begin(), errors.end()), errors.end());
  method.call = [handler = std::move(handler)](const nlohmann::json& named, CallContext& context) mutable {
    P params{};
    std::vector<Problem> problems;
    read_json(named, params, "", problems);
    if (!problems.empty()) throw Error(ErrorCode::invalid_params, "Invalid params", std::move(problems));
    if constexpr (std::is_void_v<R>) {
      method_detail::invoke<P>(handler, params, context);
      return nlohmann::json(nullptr);
    } else {
      return write_json(method_detail::invoke<P>(handler, params, context));
    }
  };
  return method;
}

}  // namespace ferrobench::server
