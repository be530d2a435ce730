#include "server/rpc/schemas.h"

#include <algorithm>
#include <array>
#include <map>

#include "recordings/format/recording.h"

namespace ferrobench::server::schema {
namespace {

json with_doc(json schema, const char* doc) {
  if (*doc != 0) schema["description"] = doc;
  return schema;
}

const json every_type{"null", "boolean", "number", "string", "array", "object"};

// What a member of this name is, where its type does not say it.
const json* known(const std::string& name, bool result) {
  static const json named_or_given{{"type", {"null", "string", "object"}},
                                   {"properties", json::object()},
                                   {"additionalProperties", any()}};
  static const std::map<std::string, json, std::less<>> all{
      {"protocol", named_or_given},
      {"model", named_or_given},
      {"config", or_null(any_object())},
      {"set", any_object()},
      {"parameters", map_of(number())},
      {"values", any_object()},
      {"info", any_object()},
      {"result", or_null(any_object())},
      {"error", or_null(object({{"name", text()}, {"message", text()}, {"problems", list_of(problem())}}))},
      {"problems", list_of(problem())}};
  static const json itself = or_null(any_object());
  if (result && (name == "protocol" || name == "model")) return &itself;
  const auto found = all.find(name);
  return found == all.end() ? nullptr : &found->second;
}

bool has_shape(const json& schema) {
  constexpr std::array keys{"type", "enum", "oneOf", "anyOf", "$ref"};
  return std::ranges::any_of(keys, [&](const char* key) { return schema.contains(key); });
}

}  // namespace

json text(const char* doc) {
  return with_doc({{"type", "string"}}, doc);
}
json number(const char* unit, const char* doc) {
  json out{{"type", "number"}};
  if (*unit != 0) out["x-unit"] = unit;
  return with_doc(std::move(out), doc);
}
json whole(const char* doc) {
  return with_doc({{"type", "integer"}}, doc);
}
json truth(const char* doc) {
  return with_doc({{"type", "boolean"}}, doc);
}
json or_null(json schema) {
  auto& type = schema["type"];
  if (!type.is_array()) type = json::array({type});
  type.push_back("null");
  return schema;
}
json object(std::initializer_list<std::pair<const char*, json>> members, const json& others) {
  json out{{"type", "object"}, {"properties", json::object()}, {"additionalProperties", others}};
  for (const auto& [name, schema] : members) out["properties"][name] = schema;
  return out;
}
json map_of(const json& each, const char* doc) {
  return with_doc(object({}, each), doc);
}
json list_of(const json& each, const char* doc) {
  return with_doc({{"type", "array"}, {"items", each}}, doc);
}
json any(const char* doc) {
  return with_doc(
      {{"type", every_type}, {"items", true}, {"properties", json::object()}, {"additionalProperties", true}},
      doc);
}
json any_object(const char* doc) {
  return with_doc(object({}, true), doc);
}

json json_schema_document() {
  return object({{"$schema", text("dialect that it is written in")},
                 {"$id", text()},
                 {"title", text()},
                 {"description", text()},
                 {"type", any("one of JSON's types, or several")},
                 {"properties", map_of(any(), "what each member may be, as a JSON Schema")},
                 {"required", list_of(text(), "members that must be there")},
                 {"$defs", map_of(any(), "schemas that others refer to")}},
                any());
}

json problem() {
  auto out = object({{"path", text("JSON pointer into what was given; \"\": the whole")},
                     {"message", text("what is wrong with it")},
                     {"given", any()},
                     {"allowed", any("one value, a list of them, or {from, to}")},
                     {"unit", text("of given and allowed")},
                     {"hint", text("what to do")}});
  out["required"] = {"path", "message"};
  return out;
}

json stretches() {
  auto out = object({{"rows", whole("joined into the stretches")},
                     {"time", list_of(number("s"), "of the first row of each stretch")}});
  for (const auto channel : recordings::all_channels) {
    const std::string unit(recordings::channel_unit(channel));
    const auto values = list_of(or_null(number(unit.c_str())), "null where nothing was measured");
    out["properties"][std::string(recordings::channel_name(channel))] =
        object({{"first", values}, {"min", values}, {"max", values}});
  }
  return out;
}

void name_the_unnamed(json& schema, bool result) {
  if (schema.contains("properties"))
    for (auto& [name, member] : schema["properties"].items()) {
      if (const auto* shape = known(name, result);
          shape != nullptr && member.is_object() && !has_shape(member)) {
        member.update(*shape);
      }
      // All lists of names are of texts. Who makes a client of a schema takes one without a type for
      // anything.
      if (member.is_object() && member.contains("enum") && !member.contains("type"))
        member["type"] = "string";
      if (member.is_object()) name_the_unnamed(member, result);
    }
  if (schema.contains("items") && schema["items"].is_object()) {
    if (!has_shape(schema["items"])) schema["items"].update(any());
    name_the_unnamed(schema["items"], result);
  }
}

}  // namespace ferrobench::server::schema
