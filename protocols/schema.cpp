#include "protocols/program.h"
#include "protocols/protocol.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;

// A number may be "$name" too, and nothing may be null. Limits in the schema bind numbers only, the pattern
// strings only, so both may stand side by side.
void allow_parameters(json& schema) {
  if (schema.contains("properties"))
    for (auto& [name, property] : schema["properties"].items()) allow_parameters(property);
  if (schema.contains("items")) allow_parameters(schema["items"]);
  if (!schema.contains("type")) return;
  auto& type = schema["type"];
  if (type.is_array()) type = type[0];
  if (type != "number" && type != "integer") return;
  type = {type, "string"};
  schema["pattern"] = parameter_use_pattern;
}

json exactly_one(std::initializer_list<const char*> keys) {
  auto out = json::array();
  for (const auto* key : keys) out.push_back({{"required", {key}}});
  return out;
}

json if_then(const char* key, json value, json then) {
  return {{"if", {{"properties", {{key, {{"const", std::move(value)}}}}}, {"required", {key}}}},
          {"then", std::move(then)}};
}

// What binds several fields of one kind together; the same rules stand in segments.cpp.
void relate(json& s, const Ramp&) {
  s["oneOf"] = exactly_one({"rate", "time"});
}
void relate(json&, const Hold&) {}
void relate(json& s, const Triangle&) {
  s["oneOf"] = exactly_one({"rate", "frequency"});
}
void relate(json&, const Sine&) {}
void relate(json& s, const Pund&) {
  s["oneOf"] = exactly_one({"rise", "rate"});
  s["properties"]["amplitude"]["not"] = {{"const", 0}};
}
void relate(json& s, const SmallSignal&) {
  s["properties"]["levels"]["minItems"] = 1;
}
void relate(json& s, const Points&) {
  s["oneOf"] = exactly_one({"points", "csv"});
  auto& points = s["properties"]["points"];
  points["minItems"] = 1;
  points["items"]["minItems"] = points["items"]["maxItems"] = 2;
}
void relate(json& s, const Repeat&) {
  s["properties"]["segments"] = {{"$ref", "#/$defs/segments"}};
  s["allOf"] = {if_then("average", true, {{"properties", {{"count", {{"minimum", fewest_averaged}}}}}})};
}
void relate(json& s, const Reversals&) {
  s["oneOf"] = exactly_one({"points", "count"});
  s["properties"]["points"]["minItems"] = 1;
  s["dependentRequired"] = {{"count", {"first", "last"}}, {"first", {"count"}}, {"last", {"count"}},
                            {"hold_back", {"back_to"}},   {"rise", {"order"}},  {"through", {"order"}}};
  const json no_second_turn = {{"properties", {{"rise", false}, {"through", false}}}};
  s["allOf"] = {if_then("order", 1, no_second_turn), if_then("order", 2, no_second_turn),
                if_then("order", 2, {{"required", {"back_to"}}}),
                if_then("order", 3, {{"required", {"back_to", "rise", "through"}}})};
}

// What binds fields together is asked only where every field has a known name: a misspelt one is then the one
// problem, and not what is missing for it as well.
void bind_known_names(json& schema) {
  auto names = json::array();
  for (const auto& [name, property] : schema["properties"].items()) names.push_back(name);
  auto then = json::object();
  for (const auto* rule : {"required", "oneOf", "allOf", "dependentRequired"}) {
    if (!schema.contains(rule)) continue;
    then[rule] = std::move(schema[rule]);
    schema.erase(rule);
  }
  schema["if"] = {{"propertyNames", {{"enum", std::move(names)}}}};
  schema["then"] = std::move(then);
}

template <class T>
json segment_schema() {
  auto schema = json_schema<Entry<T>>();
  allow_parameters(schema);
  schema["title"] = T::kind;
  schema["properties"]["kind"] = {{"const", T::kind}};
  schema["properties"]["label"]["maxLength"] = 200;
  relate(schema, T{});
  bind_known_names(schema);
  return schema;
}

// A segment is checked as what its kind says alone, so what is wrong with it is told once.
template <class... Kinds>
void add_kinds(json& definitions, std::variant<Kinds...>*) {
  auto rules = json::array();
  for (const auto kind : {Kinds::kind...})
    rules.push_back(if_then("kind", kind, {{"$ref", "#/$defs/" + std::string(kind)}}));
  definitions["segment"] = {{"type", "object"},
                            {"required", {"kind"}},
                            {"properties", {{"kind", {{"enum", {Kinds::kind...}}}}}},
                            {"allOf", std::move(rules)}};
  ((definitions[std::string(Kinds::kind)] = segment_schema<Kinds>()), ...);
}

}  // namespace

json protocol_schema() {
  auto schema = json_schema<Header>();
  auto& past = schema["properties"]["past"];
  const auto doc = past["description"];
  past = past_schema();
  past["description"] = doc;
  allow_parameters(schema);
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  schema["$id"] = "urn:ferrobench:protocol:1";
  schema["title"] = "Ferrobench protocol";
  auto& properties = schema["properties"];
  properties["version"] = {{"const", 1}};
  properties["name"]["pattern"] = name_pattern;
  properties["parameters"] = {{"type", "object"},
                              {"description", properties["parameters"]["description"]},
                              {"propertyNames", {{"pattern", parameter_name_pattern}}},
                              {"additionalProperties", {{"type", "number"}}}};
  properties["segments"] = {{"$ref", "#/$defs/segments"}};
  schema["$defs"] = {
      {"segments", {{"type", "array"}, {"minItems", 1}, {"items", {{"$ref", "#/$defs/segment"}}}}}};
  add_kinds(schema["$defs"], static_cast<Body*>(nullptr));
  bind_known_names(schema);
  return schema;
}

}  // namespace ferrobench::protocols
