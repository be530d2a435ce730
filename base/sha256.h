// SHA-256 (FIPS 180-4), as 64 lower-case hexadecimal digits: by it what was read or checked can be named.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace ferrobench {

// Of what is added piece by piece. Error(internal) where OpenSSL has none.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void add(std::span<const std::byte> bytes);
  std::string text();  // once

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

std::string sha256_of(std::span<const std::byte> bytes);
std::string sha256_of(const std::string& text);

}  // namespace ferrobench
