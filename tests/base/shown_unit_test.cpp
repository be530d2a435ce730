#include "base/shown_unit.h"

#include <gtest/gtest.h>

namespace ferrobench {
namespace {

TEST(ShownUnit, LettersOfAsciiBecomeThoseOfTheField) {
  EXPECT_EQ(shown_unit("um kV/mm"), "µm kV/mm");
  EXPECT_EQ(shown_unit("C/m^2"), "C/m²");
  EXPECT_EQ(shown_unit("J/m^3"), "J/m³");
  EXPECT_EQ(shown_unit("N/um"), "N/µm");
  EXPECT_EQ(shown_unit("Ohm m"), "Ω m");
  EXPECT_EQ(shown_unit("sum"), "sum");
  EXPECT_EQ(shown_unit(""), "");
}

}  // namespace
}  // namespace ferrobench
