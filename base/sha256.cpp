#include "base/sha256.h"

#include <openssl/evp.h>

#include <array>
#include <string_view>

#include "base/error.h"

namespace ferrobench {

namespace {

void need(bool done) {
  if (!done) throw Error(ErrorCode::internal, "SHA-256 cannot be had of OpenSSL");
}

}  // namespace

struct Sha256::Context {
  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> of{EVP_MD_CTX_new(), EVP_MD_CTX_free};
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  need(context_->of && EVP_DigestInit_ex(context_->of.get(), EVP_sha256(), nullptr) == 1);
}

Sha256::~Sha256() = default;

void Sha256::add(std::span<const std::byte> bytes) {
  need(EVP_DigestUpdate(context_->of.get(), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::text() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  need(EVP_DigestFinal_ex(context_->of.get(), digest.data(), &size) == 1);
  constexpr std::string_view digits = "0123456789abcdef";
  std::string out;
  for (unsigned i = 0; i < size; ++i) {
    out += digits[digest.at(i) >> 4];
    out += digits[digest.at(i) & 15];
  }
  return out;
}

std::string sha256_of(std::span<const std::byte> bytes) {
  Sha256 sum;
  sum.add(bytes);
  return sum.text();
}

std::string sha256_of(const std::string& text) {
  return sha256_of(std::as_bytes(std::span(text)));
}

}  // namespace ferrobench
