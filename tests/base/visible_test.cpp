#include "base/visible.h"

#include <gtest/gtest.h>

namespace ferrobench {
namespace {

TEST(Visible, LeavesWhatPeopleReadAsItIs) {
  for (const auto* text : {"", "creep at 8 MPa", "100 µm, 20 °C", "Füllung", "日本語", "\xf0\x9f\x94\xa5"})
    EXPECT_EQ(visible(text), text);
}

TEST(Visible, SpellsOutWhatATerminalObeys) {
  EXPECT_EQ(visible("a\nb\r\tc"), "a\\nb\\r\\tc");
  EXPECT_EQ(visible("\x1b[31mred\x7f"), "\\x1b[31mred\\x7f");
  EXPECT_EQ(visible(std::string_view("\0\a", 2)), "\\x00\\x07");
  EXPECT_EQ(visible("\xc2\x9b"
                    "2J"),
            "\\x9b2J");  // CSI as one character
  EXPECT_EQ(visible("\xe2\x80\xae"
                    "txt.exe"),
            "\\u202etxt.exe");  // right to left from here on
  EXPECT_EQ(visible("\xe2\x80\xa8"), "\\u2028");
}

TEST(Visible, SpellsOutWhatIsNoText) {
  EXPECT_EQ(visible("\xff"
                    "a"),
            "\\xffa");
  EXPECT_EQ(visible("\x9b"
                    "2J"),
            "\\x9b2J");
  EXPECT_EQ(visible("\xe2\x80"), "\\xe2\\x80");           // cut short
  EXPECT_EQ(visible("\xc0\x9b"), "\\xc0\\x9b");           // a detour
  EXPECT_EQ(visible("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // half of a surrogate
  EXPECT_EQ(visible("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");
}

TEST(Visible, AnErrorsLinesBecomeOne) {
  EXPECT_EQ(in_one_line("cannot be written\n  no space; given 1\n  and more"),
            "cannot be written: no space; given 1: and more");
  EXPECT_EQ(in_one_line("one"), "one");
  EXPECT_EQ(in_one_line(""), "");
}

}  // namespace
}  // namespace ferrobench
