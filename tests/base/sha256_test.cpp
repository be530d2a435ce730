#include "base/sha256.h"

#include <gtest/gtest.h>

namespace ferrobench {
namespace {

TEST(Sha256, IsThatOfTheStandard) {  // FIPS 180-2, B.1
  EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

}  // namespace
}  // namespace ferrobench
