// The service's description of itself: whole enough for a program that makes a client of it, and true.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine_bench.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

bool takes(const json& schema, const char* type) {
  const auto& types = schema.value("type", json());
  return types == type || (types.is_array() && std::ranges::find(types, type) != types.end());
}

// Every part of a schema that leaves open what it is.
void find_open(const json& schema, const std::string& path, std::vector<std::string>& out) {
  if (!schema.is_object()) return;
  if (!schema.contains("type")) out.push_back(path + " has no type");
  if (takes(schema, "object") && !schema.contains("properties")) out.push_back(path + " has no properties");
  if (takes(schema, "array") && !schema.contains("items")) out.push_back(path + " has no items");
  const auto members = schema.value("properties", json::object());
  for (const auto& [name, member] : members.items()) find_open(member, path + "/" + name, out);
  find_open(schema.value("items", json()), path + "/[]", out);
  find_open(schema.value("additionalProperties", json()), path + "/*", out);
}

// What a value has that its schema does not say.
void find_strange(const json& value, const json& schema, const std::string& path,
                  std::vector<std::string>& out) {
  if (schema.is_boolean()) {
    if (!schema.get<bool>()) out.push_back(path + " is not in the schema");
    return;
  }
  static const std::map<json::value_t, const char*> names{{json::value_t::null, "null"},
                                                          {json::value_t::boolean, "boolean"},
                                                          {json::value_t::string, "string"},
                                                          {json::value_t::array, "array"},
                                                          {json::value_t::object, "object"},
                                                          {json::value_t::number_integer, "integer"},
                                                          {json::value_t::number_unsigned, "integer"},
                                                          {json::value_t::number_float, "number"}};
  const std::string name = names.at(value.type());
  if (schema.contains("type") && !takes(schema, name.c_str()) &&
      !(name == "integer" && takes(schema, "number")))
    out.push_back(path + " is " + name + ", not " + schema["type"].dump());
  if (value.is_array())
    for (const auto& item : value) find_strange(item, schema.value("items", json(true)), path + "/[]", out);
  if (!value.is_object()) return;
  const auto members = schema.value("properties", json::object());
  for (const auto& [key, member] : value.items())
    find_strange(member,
                 members.contains(key) ? members[key] : schema.value("additionalProperties", json(true)),
                 path + "/" + key, out);
}

class OpenRpc : public EngineTest {
 protected:
  OpenRpc() {
    add_all_methods(rpc, engine);
    document = rpc.call("rpc.discover", json::object(), caller);
  }
  json call(const std::string& name, const json& params) {
    auto result = rpc.call(name, params, caller);
    const auto row =
        std::ranges::find_if(document["methods"], [&](const json& m) { return m["name"] == name; });
    find_strange(result, (*row)["result"]["schema"], name, strange);
    called.push_back(name);
    return result;
  }
  static std::string name_of_run(const json& status) { return status.at("recording"); }

  Dispatcher rpc;
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  json document;
  std::vector<std::string> strange, called;
};

TEST_F(OpenRpc, LeavesNothingOpen) {
  std::vector<std::string> open;
  for (const auto& method : document["methods"]) {
    const auto name = method["name"].get<std::string>();
    for (const auto& param : method["params"]) {
      const auto path = name + "(" + param["name"].get<std::string>() + ")";
      find_open(param["schema"], path, open);
      if (param.value("description", "").empty()) open.push_back(path + " has no description");
    }
    const auto& result = method["result"]["schema"];
    find_open(result, name + " ->", open);
    if (takes(result, "object") && result["properties"].empty())
      open.push_back(name + " says nothing of its result");
  }
  for (const auto& topic : document["x-notifications"]) find_open(topic["params"], topic["name"], open);
  EXPECT_THAT(open, testing::IsEmpty());
}

TEST_F(OpenRpc, EachMethodListsItsOwnErrors) {
  std::size_t all = 0;
  for (const auto& method : document["methods"]) {
    all += method["errors"].size();
    EXPECT_LT(method["errors"].size(), error_table().size()) << method["name"];
    const auto lists = [&](const char* name) {
      return std::ranges::any_of(method["errors"], [&](const json& e) {
        return e["$ref"] == std::string("#/components/errors/") + name;
      });
    };
    EXPECT_TRUE(lists("invalid_params")) << method["name"];  // for a parameter that there is not, too
    const bool gated =
        method["x-role"] == "control" || method["name"].get<std::string>().starts_with("lease.");
    EXPECT_TRUE(!gated || lists("not_controller") || method["name"] == "lease.status") << method["name"];
    EXPECT_FALSE(method["x-role"] == "stop" && lists("busy")) << method["name"];
  }
  EXPECT_LT(all, document["methods"].size() * 8);
}

// What is shown as a call would be taken: its parameters are those there are, all that must be there, and of
// their types.
TEST_F(OpenRpc, EachMethodHasAnExample) {
  for (const auto& method : document["methods"]) {
    const auto name = method["name"].get<std::string>();
    ASSERT_EQ(method.value("examples", json::array()).size(), 1u) << name;
    json shown = json::object();
    for (const auto& param : method["examples"][0]["params"])
      shown[param["name"].get<std::string>()] = param["value"];
    json schema{{"type", "object"}, {"properties", json::object()}, {"additionalProperties", false}};
    for (const auto& param : method["params"]) {
      schema["properties"][param["name"].get<std::string>()] = param["schema"];
      EXPECT_TRUE(!param["required"].get<bool>() || shown.contains(param["name"]))
          << name << " " << param["name"];
    }
    find_strange(shown, schema, name, strange);
  }
  EXPECT_THAT(strange, testing::IsEmpty());
  EXPECT_EQ(method_examples().size(), document["methods"].size()) << "one of them is of no method";
}

// What comes back is what the document says.
TEST_F(OpenRpc, IsTrue) {
  for (const auto* name : {"system.info", "limits.get", "device.list", "protocol.list", "protocol.schema",
                           "model.list", "model.schema", "model.effects", "table.list", "lease.status",
                           "run.status", "run.list", "rpc.discover"})
    call(name, json::object());
  call("limits.set", {{"field_max", 1.5e6}});
  const auto shipped = call("protocol.get", {{"name", "full-loops"}})["protocol"];
  call("protocol.validate", {{"protocol", shipped}});
  EXPECT_FALSE(call("protocol.validate", {{"protocol", {{"format", 5}}}})["valid"].get<bool>());
  call("protocol.put", {{"name", "mine"}, {"protocol", shipped}});
  call("protocol.list", json::object());
  auto high = trapezium(0.05, 0.05);
  high["segments"][0]["to"] = 3;
  EXPECT_EQ(call("protocol.preview", {{"protocol", high}})["problems"].size(), 3u) << "up, hold and down";
  call("model.put", {{"name", "mine"}, {"model", call("model.get", {{"name", "soft-pzt"}})["model"]}});
  const auto device = call("device.open", {{"device", "virtual"}, {"config", {{"clock", "fast"}}}})["device"];
  call("device.info", {{"device", device}});
  call("device.selftest", {{"device", device}});
  call("device.close", {{"device", device}});
  call("run.start", {{"protocol", trapezium(0.05, 0.05)}, {"fast", true}});
  const auto first = name_of_run(call("run.status", {{"run", engine.wait(engine.status().run).run}}));
  call("job.status", {{"job", engine.status().run}});
  call("replay.start", {{"recording", first}, {"fast", true}});
  const auto second = name_of_run(write_json(engine.wait(engine.status().run)));
  call("run.list", json::object());
  call("recording.list", json::object());
  call("recording.info", {{"name", first}});
  EXPECT_EQ(call("recording.read", {{"name", first}})["rows"], 31);
  EXPECT_EQ(call("recording.read", {{"name", first}, {"axes", {"field", "charge"}}})["rows"], 31);
  call("table.compare", {{"table", "3.11"}, {"recordings", {first}}});
  for (const auto* format : {"json", "text"}) call("recording.report", {{"name", first}, {"format", format}});
  call("recording.compare", {{"a", first}, {"b", second}});
  call("recording.annotate", {{"name", first}, {"text", "a note"}});
  call("recording.export", {{"name", first}});
  call("recording.recover", json::object());
  auto passes = trapezium(0.05, 0.05);
  passes["segments"] =
      json::array({{{"kind", "repeat"}, {"count", 3}, {"average", true}, {"segments", passes["segments"]}}});
  call("run.start", {{"protocol", passes}, {"fast", true}});
  const auto third = name_of_run(write_json(engine.wait(engine.status().run)));
  EXPECT_EQ(call("recording.average", {{"name", third}})["passes"], json({2, 3}));
  EXPECT_THROW(rpc.call("recording.average", {{"name", first}}, caller), Error);
  call("recording.delete", {{"name", second}});
  const json planned{{"run", {{"protocol", trapezium(0.05, 0.05)}}},
                     {"sweeps", {{{"set", "top"}, {"values", {0.1, 0.2}}}}},
                     {"repeats", 2}};
  const auto queued = call("queue.add", {{"plan", planned}});
  call("queue.move", {{"item", queued["first_item"]}});
  call("queue.list", json::object());
  for (const auto* format : {"json", "csv"})
    call("queue.summary", {{"plan", queued["plan"]}, {"format", format}});
  call("queue.stop", json::object());
  call("queue.remove", {{"plan", queued["plan"]}});
  const auto lease = call("lease.acquire", json::object())["lease"];
  call("lease.present", {{"lease", lease}});
  call("lease.renew", json::object());
  call("lease.release", json::object());
  EXPECT_THAT(strange, testing::IsEmpty());
}

TEST_F(OpenRpc, ASurpriseIsNoted) {
  rpc.add<NoParams>({.name = "surprise", .doc = "fails", .errors = {ErrorCode::busy}},
                    [](const NoParams&) { throw Error(ErrorCode::numerical, "unheard of"); });
  EXPECT_THROW(rpc.call("surprise", json::object(), caller), Error);
  EXPECT_THAT(Dispatcher::unlisted_errors(), testing::Contains("surprise: numerical"));
}

// After all tests of a process: no method has given an error that it does not list.
class NoSurprises final : public testing::Environment {
 public:
  void TearDown() override {
    auto all = Dispatcher::unlisted_errors();
    std::erase(all, "surprise: numerical");
    EXPECT_THAT(all, testing::IsEmpty());
  }
};
[[maybe_unused]] const auto* const no_surprises = testing::AddGlobalTestEnvironment(new NoSurprises);

}  // namespace
}  // namespace ferrobench::server
