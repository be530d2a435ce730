// What the specification leaves to the server: limits, hints, roles, errors of the table.
#include <gtest/gtest.h>

#include "server/rpc/dispatcher.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct Level {
  double level = 0;
  std::optional<std::string> note;
};
template <class Visitor>
void describe(Visitor& visit, Level& l) {
  visit("note", l.note, {});
  visit("level_kV_per_mm", l.level, {.unit = "kV/mm", .min = -2, .max = 2, .required = true});
}

class RpcDispatcher : public testing::Test {
 protected:
  RpcDispatcher() {
    rpc.add<Level>({.name = "limits.set", .doc = "sets", .role = Role::control}, [this](const Level& l) {
      set = l;
      return l;
    });
    rpc.add<NoParams>({.name = "run.start", .doc = "fails", .errors = {ErrorCode::busy}},
                      [](const NoParams&) {
                        throw Error(ErrorCode::busy, "a run goes on",
                                    Problem{.path = "/run", .message = "is not over", .hint = "wait"});
                      });
    rpc.add<NoParams>({.name = "system.break", .doc = "breaks"},
                      [](const NoParams&) { throw std::runtime_error("secret detail"); });
    rpc.add<NoParams>({.name = "system.name", .doc = "not UTF-8"},
                      [](const NoParams&) -> json { return "\xff.h5"; });
  }
  json ask(const std::string& request) { return json::parse(rpc.handle(request, caller).value_or("null")); }
  json call(const std::string& method, const json& params) {
    return ask(json{{"jsonrpc", "2.0"}, {"method", method}, {"params", params}, {"id", 1}}.dump());
  }

  Dispatcher rpc{{.max_bytes = 10'000, .max_depth = 10, .max_batch = 3}};
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  std::optional<Level> set;
};

TEST_F(RpcDispatcher, InvalidParamsNameEveryProblem) {
  const auto error = call("limits.set", {{"level_kV_per_mm", 7}, {"nota", "x"}})["error"];
  EXPECT_EQ(error["code"], -32602);
  EXPECT_EQ(error["message"], "Invalid params");
  EXPECT_EQ(error["data"]["name"], "invalid_params");
  const auto problems = error["data"]["problems"];
  ASSERT_EQ(problems.size(), 2u);
  EXPECT_EQ(problems[0]["path"], "/level_kV_per_mm");
  EXPECT_EQ(problems[0]["unit"], "kV/mm");
  EXPECT_EQ(problems[1]["hint"], "did you mean \"note\"?");
  EXPECT_FALSE(set.has_value());
}

TEST_F(RpcDispatcher, RequiredParametersComeFirstByPosition) {
  EXPECT_EQ(call("limits.set", {1.5, "up"})["result"], (json{{"level_kV_per_mm", 1.5}, {"note", "up"}}));
  const auto error = call("limits.set", {1.5, "up", 3})["error"];
  EXPECT_EQ(error["code"], -32602);
  EXPECT_EQ(error["data"]["problems"][0]["allowed"], 2);
  EXPECT_EQ(call("limits.set", json::array())["error"]["data"]["problems"][0]["message"], "is missing");
}

TEST_F(RpcDispatcher, ErrorsOfTheTableKeepCodeNameAndProblems) {
  const auto error = call("run.start", json::object())["error"];
  EXPECT_EQ(error, json::parse(R"({"code": -32009, "message": "a run goes on", "data": {"name": "busy",
    "problems": [{"path": "/run", "message": "is not over", "hint": "wait"}]}})"));
}

TEST_F(RpcDispatcher, DefectsDoNotLeak) {
  const auto reply = call("system.break", json::object());
  EXPECT_EQ(reply["error"]["code"], -32603);
  EXPECT_EQ(reply["error"]["message"], "Internal error");
  EXPECT_EQ(reply.dump().find("secret"), std::string::npos);
}

TEST_F(RpcDispatcher, UnknownMethodGetsTheNearestName) {
  const auto error = call("limit.set", json::object())["error"];
  EXPECT_EQ(error["code"], -32601);
  EXPECT_EQ(error["data"]["problems"][0]["hint"], "did you mean \"limits.set\"?");
  const auto far = call(std::string(5000, 'x'), json::object())["error"]["data"]["problems"][0];
  EXPECT_EQ(far["hint"], "rpc.discover lists the methods");
  EXPECT_LT(far["given"].get<std::string>().size(), 100u);
}

TEST_F(RpcDispatcher, IdsOfEveryKindComeBack) {
  for (const char* id :
       {"1", "-7", "1.5", "\"a\"", "\"\"", "null", "9007199254740993", "18446744073709551615"}) {
    const auto reply = ask(std::string(R"({"jsonrpc":"2.0","method":"system.name","id":)") + id + "}");
    EXPECT_EQ(reply["id"].dump(), id);
    EXPECT_TRUE(reply.contains("result"));
  }
  for (const char* id : {"true", "[1]", "{}"}) {
    const auto reply = ask(std::string(R"({"jsonrpc":"2.0","method":"system.name","id":)") + id + "}");
    EXPECT_EQ(reply["error"]["code"], -32600) << id;
    EXPECT_TRUE(reply["id"].is_null());
  }
}

TEST_F(RpcDispatcher, MalformedRequests) {
  for (const char* request :
       {R"({"method":"system.name","id":1})", R"({"jsonrpc":"1.0","method":"system.name","id":1})",
        R"({"jsonrpc":2.0,"method":"system.name","id":1})", R"({"jsonrpc":"2.0","id":1})",
        R"({"jsonrpc":"2.0","method":null,"id":1})",
        R"({"jsonrpc":"2.0","method":"system.name","params":3,"id":1})",
        R"({"jsonrpc":"2.0","method":"system.name","params":null,"id":1})"}) {
    const auto reply = ask(request);
    EXPECT_EQ(reply["error"]["code"], -32600) << request;
    EXPECT_EQ(reply["id"], 1) << request;
    EXPECT_FALSE(reply["error"]["data"]["problems"][0]["message"].get<std::string>().empty());
  }
  for (const char* request : {"1", "\"x\"", "null", "true"})
    EXPECT_EQ(ask(request)["error"]["code"], -32600) << request;
  for (const char* text :
       {"", "  ", "nul", "{\"a\":1}x", "\xff", "{\"jsonrpc\":\"2.0\",\"jsonrpc\":\"2.0\"}", "[1e999]"})
    EXPECT_EQ(ask(text)["error"]["code"], -32700) << text;
}

TEST_F(RpcDispatcher, SizeDepthAndBatchAreBounded) {
  EXPECT_EQ(ask(std::string(10'001, ' '))["error"]["code"], -32700);
  EXPECT_EQ(ask(std::string(11, '[') + std::string(11, ']'))["error"]["code"], -32700);
  EXPECT_EQ(ask("[1,2,3]").size(), 3u);
  const auto reply = ask("[1,2,3,4]");
  EXPECT_EQ(reply["error"]["code"], -32600);
  EXPECT_EQ(reply["error"]["data"]["problems"][0]["allowed"], 3);
}

TEST_F(RpcDispatcher, RepliesAreUtf8WhateverTheResult) {
  EXPECT_EQ(call("system.name", json::object())["result"], "\xef\xbf\xbd.h5");
}

TEST_F(RpcDispatcher, GateStandsBeforeControlOnly) {
  rpc.set_gate([](const Method& method, const CallContext& who) {
    if (who.lease != "mine") throw Error(ErrorCode::not_controller, "another client may " + method.info.name);
  });
  EXPECT_EQ(call("limits.set", {{"level_kV_per_mm", 1}})["error"]["data"]["name"], "not_controller");
  EXPECT_FALSE(set.has_value());
  EXPECT_TRUE(call("system.name", json::object()).contains("result"));
  caller.lease = "mine";
  EXPECT_TRUE(call("limits.set", {{"level_kV_per_mm", 1}}).contains("result"));
}

TEST_F(RpcDispatcher, CallsInProcessThrow) {
  EXPECT_EQ(rpc.call("limits.set", {{"level_kV_per_mm", 1}}, caller), (json{{"level_kV_per_mm", 1.0}}));
  const auto code_of = [&](const char* method) {
    try {
      rpc.call(method, nullptr, caller);
    } catch (const Error& e) {
      return e.code();
    }
    return ErrorCode::internal;
  };
  EXPECT_EQ(code_of("limits.set"), ErrorCode::invalid_params);
  EXPECT_EQ(code_of("limits.sat"), ErrorCode::not_found);
  EXPECT_EQ(code_of("run.start"), ErrorCode::busy);
}

}  // namespace
}  // namespace ferrobench::server
