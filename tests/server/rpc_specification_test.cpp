// The examples of the JSON-RPC 2.0 specification, section 7, one by one. The specification leaves
// `error.data` to the server; ours always has it and is looked at in rpc_dispatcher_test.cpp, so it is taken
// off before the comparison.
#include <gtest/gtest.h>

#include "server/rpc/dispatcher.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct Subtraction {
  std::int64_t minuend = 0;
  std::int64_t subtrahend = 0;
};
template <class Visitor>
void describe(Visitor& visit, Subtraction& s) {
  visit("minuend", s.minuend, {.required = true});
  visit("subtrahend", s.subtrahend, {.required = true});
}

struct Addends {
  std::optional<std::int64_t> a, b, c;
};
template <class Visitor>
void describe(Visitor& visit, Addends& s) {
  visit("a", s.a, {});
  visit("b", s.b, {});
  visit("c", s.c, {});
}

class JsonRpcSpecification : public testing::Test {
 protected:
  JsonRpcSpecification() {
    rpc.add<Subtraction>({.name = "subtract", .doc = "a - b", .result_schema = {{"type", "integer"}}},
                         [](const Subtraction& s) -> json { return s.minuend - s.subtrahend; });
    rpc.add<Addends>(
        {.name = "sum", .doc = "a + b + c", .result_schema = {{"type", "integer"}}},
        [](const Addends& s) -> json { return s.a.value_or(0) + s.b.value_or(0) + s.c.value_or(0); });
    rpc.add<NoParams>({.name = "get_data", .doc = "data", .result_schema = {{"type", "array"}}},
                      [](const NoParams&) -> json {
                        return {"hello", 5};
                      });
    rpc.add<Addends>({.name = "notify_hello", .doc = "says hello"}, [this](const Addends&) { ++hellos; });
  }

  void expect(std::string_view request, const char* response) {
    const auto reply = rpc.handle(request, caller);
    ASSERT_TRUE(reply.has_value());
    auto got = json::parse(*reply);
    const auto strip = [](json& one) {
      if (one.contains("error")) one["error"].erase("data");
    };
    if (got.is_array()) {
      for (auto& one : got) strip(one);
    } else {
      strip(got);
    }
    EXPECT_EQ(got, json::parse(response));
  }
  void expect_silence(std::string_view request) { EXPECT_EQ(rpc.handle(request, caller), std::nullopt); }

  Dispatcher rpc;
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  int hellos = 0;
};

TEST_F(JsonRpcSpecification, CallWithPositionalParameters) {
  expect(R"({"jsonrpc": "2.0", "method": "subtract", "params": [42, 23], "id": 1})",
         R"({"jsonrpc": "2.0", "result": 19, "id": 1})");
  expect(R"({"jsonrpc": "2.0", "method": "subtract", "params": [23, 42], "id": 2})",
         R"({"jsonrpc": "2.0", "result": -19, "id": 2})");
}

TEST_F(JsonRpcSpecification, CallWithNamedParameters) {
  expect(R"({"jsonrpc": "2.0", "method": "subtract", "params": {"subtrahend": 23, "minuend": 42}, "id": 3})",
         R"({"jsonrpc": "2.0", "result": 19, "id": 3})");
  expect(R"({"jsonrpc": "2.0", "method": "subtract", "params": {"minuend": 42, "subtrahend": 23}, "id": 4})",
         R"({"jsonrpc": "2.0", "result": 19, "id": 4})");
}

TEST_F(JsonRpcSpecification, Notifications) {
  expect_silence(R"({"jsonrpc": "2.0", "method": "update", "params": [1,2,3,4,5]})");
  expect_silence(R"({"jsonrpc": "2.0", "method": "foobar"})");
  expect_silence(R"({"jsonrpc": "2.0", "method": "notify_hello", "params": [7]})");
  EXPECT_EQ(hellos, 1);
}

TEST_F(JsonRpcSpecification, CallOfMissingMethod) {
  expect(R"({"jsonrpc": "2.0", "method": "foobar", "id": "1"})",
         R"({"jsonrpc": "2.0", "error": {"code": -32601, "message": "Method not found"}, "id": "1"})");
}

TEST_F(JsonRpcSpecification, CallWithInvalidJson) {
  expect(R"({"jsonrpc": "2.0", "method": "foobar, "params": "bar", "baz])",
         R"({"jsonrpc": "2.0", "error": {"code": -32700, "message": "Parse error"}, "id": null})");
}

TEST_F(JsonRpcSpecification, CallWithInvalidRequestObject) {
  expect(R"({"jsonrpc": "2.0", "method": 1, "params": "bar"})",
         R"({"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null})");
}

TEST_F(JsonRpcSpecification, BatchWithInvalidJson) {
  expect(R"([
    {"jsonrpc": "2.0", "method": "sum", "params": [1,2,4], "id": "1"},
    {"jsonrpc": "2.0", "method"
  ])",
         R"({"jsonrpc": "2.0", "error": {"code": -32700, "message": "Parse error"}, "id": null})");
}

TEST_F(JsonRpcSpecification, EmptyBatch) {
  expect("[]", R"({"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null})");
}

TEST_F(JsonRpcSpecification, InvalidBatchThatIsNotEmpty) {
  expect("[1]",
         R"([{"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null}])");
}

TEST_F(JsonRpcSpecification, InvalidBatch) {
  expect("[1,2,3]", R"([
    {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null},
    {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null},
    {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null}])");
}

TEST_F(JsonRpcSpecification, Batch) {
  expect(R"([
        {"jsonrpc": "2.0", "method": "sum", "params": [1,2,4], "id": "1"},
        {"jsonrpc": "2.0", "method": "notify_hello", "params": [7]},
        {"jsonrpc": "2.0", "method": "subtract", "params": [42,23], "id": "2"},
        {"foo": "boo"},
        {"jsonrpc": "2.0", "method": "foo.get", "params": {"name": "myself"}, "id": "5"},
        {"jsonrpc": "2.0", "method": "get_data", "id": "9"}
    ])",
         R"([
        {"jsonrpc": "2.0", "result": 7, "id": "1"},
        {"jsonrpc": "2.0", "result": 19, "id": "2"},
        {"jsonrpc": "2.0", "error": {"code": -32600, "message": "Invalid Request"}, "id": null},
        {"jsonrpc": "2.0", "error": {"code": -32601, "message": "Method not found"}, "id": "5"},
        {"jsonrpc": "2.0", "result": ["hello", 5], "id": "9"}
    ])");
  EXPECT_EQ(hellos, 1);
}

TEST_F(JsonRpcSpecification, BatchOfNotifications) {
  expect_silence(R"([
        {"jsonrpc": "2.0", "method": "notify_sum", "params": [1,2,4]},
        {"jsonrpc": "2.0", "method": "notify_hello", "params": [7]}
    ])");
  EXPECT_EQ(hellos, 1);
}

}  // namespace
}  // namespace ferrobench::server
