// One description of a struct's fields, from which its JSON is read, checked and written and its JSON Schema
// made.
//
// A struct takes part by a function beside it, found by argument-dependent lookup:
//
//     struct Spring { double stiffness = 0; std::optional<double> preload; };
//     template <class Visitor> void describe(Visitor& visit, Spring& s) {
//       visit("stiffness", s.stiffness, {.unit = "N/m", .min = 0, .required = true, .doc = "spring
//       constant"}); visit("preload", s.preload, {.unit = "N"});
//     }
//
// Field types: bool, integers, double, std::string, std::optional<T>, std::vector<T>, nlohmann::json (taken
// as it is), enumerations with an enum_names(E) -> std::span<const std::pair<E, std::string_view>>, and
// described structs. Reading collects every problem with its JSON pointer; an unknown key is a problem.
// Numbers must be finite.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"

namespace ferrobench {

struct FieldInfo {
  std::string_view unit{};
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool exclusive_min = false;
  bool required = false;
  std::string_view doc{};
};

// Reading stops adding problems about here: more would help nobody, and hostile input could ask for millions.
inline constexpr std::size_t max_problems = 200;

namespace fields_detail {

struct NullVisitor {
  template <class T>
  void operator()(std::string_view, T&, const FieldInfo&) {}
};
template <class T>
concept Described = requires(T& t, NullVisitor& v) {
  describe(v, t);
};
template <class T>
concept NamedEnum = std::is_enum_v<T> && requires(T t) {
  enum_names(t);
};
template <class T>
struct optional_of : std::false_type {};
template <class T>
struct optional_of<std::optional<T>> : std::true_type {
  using type = T;
};
template <class T>
struct vector_of : std::false_type {};
template <class T>
struct vector_of<std::vector<T>> : std::true_type {
  using type = T;
};

void check_number(double value, const FieldInfo& info, const std::string& path,
                  std::vector<Problem>& problems);
Problem wrong_type(const std::string& path, const nlohmann::json& given, std::string_view expected,
                   const FieldInfo& info);
Problem unknown_key(const std::string& path, const nlohmann::json& allowed);
std::string pointer(const std::string& parent, std::string_view key);

}  // namespace fields_detail

template <class T>
void read_json(const nlohmann::json& json, T& value, const std::string& path, std::vector<Problem>& problems,
               const FieldInfo& info = {});

namespace fields_detail {

struct Reader {
  const nlohmann::json& object;
  const std::string& path;
  std::vector<Problem>& problems;
  nlohmann::json known = nlohmann::json::array();

  template <class T>
  void operator()(std::string_view name, T& value, const FieldInfo& info) {
    known.push_back(name);
    const auto found = object.find(name);
    if (found == object.end()) {
      if (info.required)
        problems.push_back(
            {.path = pointer(path, name), .message = "is missing", .unit = std::string(info.unit)});
      return;
    }
    read_json(*found, value, pointer(path, name), problems, info);
  }
};

struct Writer {
  nlohmann::json out = nlohmann::json::object();
  template <class T>
  void operator()(std::string_view name, const T& value, const FieldInfo& info);
};

struct SchemaMaker {
  nlohmann::json properties = nlohmann::json::object();
  nlohmann::json required = nlohmann::json::array();
  template <class T>
  void operator()(std::string_view name, T& value, const FieldInfo& info);
};

}  // namespace fields_detail

template <class T>
void read_json(const nlohmann::json& json, T& value, const std::string& path, std::vector<Problem>& problems,
               const FieldInfo& info) {
  using namespace fields_detail;
  if constexpr (std::same_as<T, nlohmann::json>) {
    value = json;
  } else if constexpr (optional_of<T>::value) {
    if (json.is_null()) {
      value.reset();
    } else {
      typename optional_of<T>::type inner{};
      if (value) inner = *value;
      read_json(json, inner, path, problems, info);
      value = std::move(inner);
    }
  } else if constexpr (vector_of<T>::value) {
    if (!json.is_array()) return problems.push_back(wrong_type(path, json, "an array", info));
    value.clear();
    value.reserve(json.size());
    for (std::size_t i = 0; i < json.size() && problems.size() < max_problems; ++i) {
      typename vector_of<T>::type item{};
      read_json(json[i], item, pointer(path, std::to_string(i)), problems, info);
      value.push_back(std::move(item));
    }
  } else if constexpr (std::same_as<T, bool>) {
    if (!json.is_boolean()) return problems.push_back(wrong_type(path, json, "true or false", info));
    value = json.get<bool>();
  } else if constexpr (std::integral<T>) {
    const bool whole = json.is_number_integer() ||
                       (json.is_number_float() && std::floor(json.get<double>()) == json.get<double>());
    if (!whole || std::abs(json.get<double>()) > 9.0e15 ||
        (std::unsigned_integral<T> && json.get<double>() < 0) ||
        json.get<double>() > static_cast<double>(std::numeric_limits<T>::max()))
      return problems.push_back(wrong_type(path, json, "a whole number", info));
    check_number(json.get<double>(), info, path, problems);
    value = json.is_number_float() ? static_cast<T>(json.get<double>()) : json.get<T>();
  } else if constexpr (std::floating_point<T>) {
    if (!json.is_number()) return problems.push_back(wrong_type(path, json, "a number", info));
    check_number(json.get<double>(), info, path, problems);
    value = json.get<T>();
  } else if constexpr (std::same_as<T, std::string>) {
    if (!json.is_string()) return problems.push_back(wrong_type(path, json, "a string", info));
    value = json.get<std::string>();
  } else if constexpr (NamedEnum<T>) {
    nlohmann::json allowed = nlohmann::json::array();
    for (const auto& [item, name] : enum_names(T{})) {
      if (json.is_string() && json.get_ref<const std::string&>() == name) {
        value = item;
        return;
      }
      allowed.push_back(name);
    }
    problems.push_back(
        {.path = path, .message = "is not one of the names allowed", .given = json, .allowed = allowed});
  } else {
    static_assert(Described<T>, "give the type a describe() function");
    if (!json.is_object()) return problems.push_back(wrong_type(path, json, "an object", info));
    Reader reader{json, path, problems};
    describe(reader, value);
    for (const auto& [key, item] : json.items()) {
      if (problems.size() >= max_problems) return;
      bool known = false;
      for (const auto& name : reader.known) known = known || name == key;
      if (!known) problems.push_back(unknown_key(pointer(path, key), reader.known));
    }
  }
}

template <class T>
nlohmann::json write_json(const T& value) {
  using namespace fields_detail;
  if constexpr (optional_of<T>::value) {
    return value ? write_json(*value) : nlohmann::json(nullptr);
  } else if constexpr (vector_of<T>::value) {
    auto out = nlohmann::json::array();
    for (const auto& item : value) out.push_back(write_json(item));
    return out;
  } else if constexpr (NamedEnum<T>) {
    for (const auto& [item, name] : enum_names(T{}))
      if (item == value) return name;
    return nullptr;
  } else if constexpr (Described<T>) {
    Writer writer;
    describe(writer,
             const_cast<T&>(value));  // describe() takes one non-const form for readers and writers alike
    return std::move(writer.out);
  } else {
    return value;
  }
}

// JSON Schema (draft 2020-12) of T; units stand under "x-unit".
template <class T>
nlohmann::json json_schema(const FieldInfo& info = {}) {
  using namespace fields_detail;
  nlohmann::json out = nlohmann::json::object();
  if constexpr (std::same_as<T, nlohmann::json>) {
  } else if constexpr (optional_of<T>::value) {
    out = json_schema<typename optional_of<T>::type>(info);
    if (out.contains("type") && out["type"].is_string()) out["type"] = {out["type"], "null"};
    return out;
  } else if constexpr (vector_of<T>::value) {
    out = {{"type", "array"}, {"items", json_schema<typename vector_of<T>::type>(info)}};
  } else if constexpr (std::same_as<T, bool>) {
    out["type"] = "boolean";
  } else if constexpr (std::is_arithmetic_v<T>) {
    out["type"] = std::integral<T> ? "integer" : "number";
    if (std::isfinite(info.min)) out[info.exclusive_min ? "exclusiveMinimum" : "minimum"] = info.min;
    if (std::isfinite(info.max)) out["maximum"] = info.max;
  } else if constexpr (std::same_as<T, std::string>) {
    out["type"] = "string";
  } else if constexpr (NamedEnum<T>) {
    out["enum"] = nlohmann::json::array();
    for (const auto& [item, name] : enum_names(T{})) out["enum"].push_back(name);
  } else {
    T sample{};
    SchemaMaker maker;
    describe(maker, sample);
    out = {{"type", "object"}, {"properties", maker.properties}, {"additionalProperties", false}};
    if (!maker.required.empty()) out["required"] = maker.required;
  }
  if (!info.unit.empty() && !vector_of<T>::value) out["x-unit"] = info.unit;
  if (!info.doc.empty()) out["description"] = info.doc;
  return out;
}

template <class T>
void fields_detail::Writer::operator()(std::string_view name, const T& value, const FieldInfo&) {
  if constexpr (optional_of<T>::value) {
    if (!value) return;
  }
  out[std::string(name)] = write_json(value);
}

template <class T>
void fields_detail::SchemaMaker::operator()(std::string_view name, T& value, const FieldInfo& info) {
  auto schema = json_schema<T>(info);
  if constexpr (std::is_arithmetic_v<T> || std::same_as<T, std::string> || NamedEnum<T>)
    if (!info.required) schema["default"] = write_json(value);
  properties[std::string(name)] = std::move(schema);
  if (info.required) required.push_back(name);
}

// Reads all of `json` into a T. Throws Error(code, ...) with every problem found.
template <class T>
T parse(const nlohmann::json& json, ErrorCode code, std::string_view what) {
  T value{};
  std::vector<Problem> problems;
  read_json(json, value, "", problems);
  if (!problems.empty()) throw Error(code, std::string(what) + " is not valid", std::move(problems));
  return value;
}

// Text from outside into JSON: at most max_bytes long and max_depth deep, UTF-8, no duplicate keys.
// Throws Error(code) that says where it broke.
nlohmann::json parse_json_text(std::string_view text, ErrorCode code, std::string_view what,
                               std::size_t max_bytes = 16u << 20, int max_depth = 32);

// The text of this key; "" where there is none, or `json` is no object.
std::string text_at(const nlohmann::json& json, const char* key);

// The start of a text from outside, fit to quote in a message: what is not printable ASCII becomes a question
// mark.
std::string excerpt(std::string_view text);

// The nearest of the allowed names to a mistyped one, or "".
std::string nearest_name(std::string_view given, std::span<const std::string> allowed);

}  // namespace ferrobench
