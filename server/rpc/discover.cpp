#include "server/rpc/discover.h"

#include <utility>

#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

std::string area(const std::string& method) {
  const auto dot = method.find('.');
  return dot == std::string::npos ? "notifications" : method.substr(0, dot);
}

const char* role_name(Role role) {
  switch (role) {
    case Role::view:
      return "view";
    case Role::control:
      return "control";
    case Role::stop:
      return "stop";
  }
  return "";
}

// A call as OpenRPC writes it.
json example_of(const std::string& method, const json& parameters) {
  json params = json::array();
  for (const auto& [name, value] : parameters.items()) params.push_back({{"name", name}, {"value", value}});
  return {{"name", "a call of " + method}, {"params", std::move(params)}};
}

json describe_method(const Method& method, const json& examples) {
  json params = json::array();
  for (const auto& p : method.parameters) {
    json named{{"properties", {{p.name, p.schema}}}};
    schema::name_the_unnamed(named);
    auto& schema = named["properties"][p.name];
    json param{{"name", p.name}, {"required", p.required}, {"schema", schema}};
    if (schema.contains("description")) param["description"] = schema["description"];
    params.push_back(std::move(param));
  }
  auto result = method.info.result_schema;
  schema::name_the_unnamed(result, true);
  json errors = json::array();
  for (const auto code : method.info.errors)
    errors.push_back({{"$ref", "#/components/errors/" + std::string(entry(code).name)}});
  json out{{"name", method.info.name},
           {"summary", method.info.doc},
           {"tags", json::array({{{"name", area(method.info.name)}}})},
           {"paramStructure", "either"},
           {"params", std::move(params)},
           {"result", {{"name", method.info.name + " result"}, {"schema", std::move(result)}}},
           {"errors", std::move(errors)},
           {"x-role", role_name(method.info.role)}};
  if (const auto found = examples.find(method.info.name); found != examples.end())
    out["examples"] = json::array({example_of(method.info.name, *found)});
  return out;
}

}  // namespace

json openrpc_document(const Dispatcher& dispatcher, const Hub& hub, const std::string& version,
                      const json& examples) {
  json methods = json::array();
  for (const auto& [name, method] : dispatcher.methods())
    methods.push_back(describe_method(method, examples));
  json errors = json::object();
  for (const auto& e : error_table())
    errors[std::string(e.name)] = {{"code", e.rpc_code},
                                   {"message", e.meaning},
                                   {"data", {{"name", e.name}, {"problems", json::array()}}}};
  json topics = json::array();
  for (const auto& [name, topic] : hub.topics()) {
    auto params = topic.schema;
    schema::name_the_unnamed(params, true);
    topics.push_back({{"name", name}, {"summary", topic.doc}, {"params", std::move(params)}});
  }
  return {{"openrpc", "1.3.2"},
          {"info",
           {{"title", "ferrobench"},
            {"version", version},
            {"description",
             "Field programs, runs, recordings and models of ferroelectric actuators. SI units unless "
             "x-unit or the name says otherwise. While a client holds the lease, methods of x-role "
             "\"control\" are "
             "for that client alone; \"view\" and \"stop\" are for everybody."}}},
          {"methods", std::move(methods)},
          {"components", {{"errors", std::move(errors)}}},
          {"x-notifications", std::move(topics)}};
}

void add_discovery(Dispatcher& dispatcher, const Hub& hub, const std::string& version, json examples) {
  dispatcher.add<NoParams>(
      {.name = "rpc.discover",
       .doc = "This document: every method with its parameters, result and errors (OpenRPC).",
       .result_schema = schema::object({{"openrpc", schema::text("version of its format")},
                                        {"info", schema::any_object()},
                                        {"methods", schema::list_of(schema::any_object())},
                                        {"components", schema::any_object()},
                                        {"x-notifications", schema::list_of(schema::any_object())}})},
      [&dispatcher, &hub, version, examples = std::move(examples)](const NoParams&) -> json {
        return openrpc_document(dispatcher, hub, version, examples);
      });
}

}  // namespace ferrobench::server
