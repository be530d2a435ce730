// JSON Schemas of what has no struct of its own: JSON that is passed on as it is, and results put together by
// hand.
#pragma once

#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

namespace ferrobench::server::schema {

using nlohmann::json;

json text(const char* doc = "");
json number(const char* unit = "", const char* doc = "");
json whole(const char* doc = "");
json truth(const char* doc = "");
// null as well.
json or_null(json schema);
// With these members, and no others unless `others` says what they are like.
json object(std::initializer_list<std::pair<const char*, json>> members, const json& others = false);
json map_of(const json& each, const char* doc = "");
json list_of(const json& each, const char* doc = "");
// Of whatever shape.
json any(const char* doc = "");
json any_object(const char* doc = "");

// What a JSON Schema is itself, as far as those of this program go.
json json_schema_document();

// {path, message, given, allowed, unit, hint}
json problem();
// Smallest, largest and first value of stretches, as recording.read and the topic "samples" give them.
json stretches();

// Says of every member that is JSON as it is (a model, a protocol, settings, ...) what it may be: its name
// means the same wherever it stands. What a caller gives may be a name in place of a model or a protocol;
// what comes back (`result`) is the thing itself.
void name_the_unnamed(json& schema, bool result = false);

}  // namespace ferrobench::server::schema
