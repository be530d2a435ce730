// Plain bytes of what the server and the bench process tell each other: numbers as they lie in memory (both
// are this program on this machine), texts and lists after their length. Nothing is taken that is not there:
// a length beyond the bytes that came is Damaged, before anything is allocated for it.
//
// A struct takes part by a function beside it:
//
//     template <class V> void fields(V& v, typename V::template Of<Stop> m) { v(m.call, m.run, m.reason); }
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace ferrobench::bench {

// What came is no message of this protocol.
struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The last value of an enumeration whose values count from 0.
template <class E>
inline constexpr E last_of{};

namespace codec_detail {
enum class Shape { other, optional, vector, array, shared };
template <class T>
inline constexpr auto shape = Shape::other;
template <class T>
inline constexpr auto shape<std::optional<T>> = Shape::optional;
template <class T>
inline constexpr auto shape<std::vector<T>> = Shape::vector;
template <class T, std::size_t n>
inline constexpr auto shape<std::array<T, n>> = Shape::array;
template <class T>
inline constexpr auto shape<std::shared_ptr<const T>> = Shape::shared;
}  // namespace codec_detail

class Encoder {
 public:
  template <class T>
  using Of = const T&;

  template <class... T>
  void operator()(const T&... values) {
    (put(values), ...);
  }
  std::string take() { return std::move(out_); }

 private:
  void bytes(const void* from, std::size_t count) { out_.append(static_cast<const char*>(from), count); }
  void length(std::size_t count) { put(static_cast<std::uint32_t>(count)); }
  void text(std::string_view value) {
    length(value.size());
    out_ += value;
  }

  template <class T>
  void put(const T& value) {
    using namespace codec_detail;
    if constexpr (std::is_enum_v<T>) {
      put(static_cast<std::uint8_t>(value));
    } else if constexpr (std::is_arithmetic_v<T>) {
      bytes(&value, sizeof value);
    } else if constexpr (std::is_same_v<T, std::string>) {
      text(value);
    } else if constexpr (std::is_same_v<T, nlohmann::json>) {
      text(value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    } else if constexpr (shape<T> == Shape::optional) {
      put(value.has_value());
      if (value) put(*value);
    } else if constexpr (shape<T> == Shape::shared) {
      put(value != nullptr);
      if (value) put(*value);
    } else if constexpr (shape<T> == Shape::vector) {
      length(value.size());
      if constexpr (std::is_same_v<T, std::vector<double>>) {
        bytes(value.data(), value.size() * sizeof(double));
      } else {
        for (const auto& item : value) put(item);
      }
    } else if constexpr (shape<T> == Shape::array) {
      for (const auto& item : value) put(item);
    } else {
      fields(*this, value);
    }
  }

  std::string out_;
};

class Decoder {
 public:
  template <class T>
  using Of = T&;

  explicit Decoder(std::string_view bytes) : left_(bytes) {}

  // Throw Damaged.
  template <class... T>
  void operator()(T&... values) {
    (get(values), ...);
  }
  void finish() const { demand(left_.empty(), "a message is longer than what it holds"); }

 private:
  static void demand(bool fine, const char* what) {
    if (!fine) throw Damaged(what);
  }
  std::string_view some(std::size_t count) {
    demand(count <= left_.size(), "a message is shorter than what it holds");
    const auto out = left_.substr(0, count);
    left_.remove_prefix(count);
    return out;
  }
  std::size_t length() {
    std::uint32_t count = 0;
    get(count);
    return count;
  }

  template <class T>
  void get(T& value) {
    using namespace codec_detail;
    if constexpr (std::is_enum_v<T>) {
      std::uint8_t number = 0;
      get(number);
      demand(number <= static_cast<std::uint8_t>(last_of<T>), "a message has an unknown value");
      value = static_cast<T>(number);
    } else if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t number = 0;
      get(number);
      demand(number <= 1, "a message has an unknown value");
      value = number == 1;
    } else if constexpr (std::is_arithmetic_v<T>) {
      std::memcpy(&value, some(sizeof value).data(), sizeof value);
    } else if constexpr (std::is_same_v<T, std::string>) {
      value = some(length());
    } else if constexpr (std::is_same_v<T, nlohmann::json>) {
      value = nlohmann::json::parse(some(length()), nullptr, false);
      demand(!value.is_discarded(), "a message holds what is no JSON");
    } else if constexpr (shape<T> == Shape::optional) {
      bool there = false;
      get(there);
      value.reset();
      if (there) get(value.emplace());
    } else if constexpr (shape<T> == Shape::shared) {
      bool there = false;
      get(there);
      value.reset();
      if (!there) return;
      auto inner = std::make_shared<std::remove_const_t<typename T::element_type>>();
      get(*inner);
      value = std::move(inner);
    } else if constexpr (shape<T> == Shape::vector) {
      const auto count = length();
      demand(count <= left_.size(), "a message is shorter than what it holds");
      value.clear();
      if constexpr (std::is_same_v<T, std::vector<double>>) {
        const auto bytes = some(count * sizeof(double));
        value.resize(count);
        if (count > 0) std::memcpy(value.data(), bytes.data(), bytes.size());
      } else {
        for (std::size_t i = 0; i < count; ++i) get(value.emplace_back());
      }
    } else if constexpr (shape<T> == Shape::array) {
      for (auto& item : value) get(item);
    } else {
      fields(*this, value);
    }
  }

  std::string_view left_;
};

}  // namespace ferrobench::bench
