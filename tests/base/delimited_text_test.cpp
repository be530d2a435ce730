// Tables in text, as RFC 4180 has them and as they come.
#include "base/delimited_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace ferrobench {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

using Rows = std::vector<std::vector<double>>;

struct Read {
  std::vector<std::string> names;
  Rows rows;
  std::vector<std::size_t> lines;
  std::vector<Problem> problems;
  char delimiter = 0;
};

constexpr double gap = -99;  // equal to itself

Read read(std::string_view text, const TextDialect& dialect = {}) {
  Read out;
  DelimitedText table(text, dialect, "/csv", out.problems, 5);
  out.names = table.names();
  out.delimiter = table.delimiter();
  while (table.next()) {
    auto& row = out.rows.emplace_back();
    out.lines.push_back(table.line());
    for (std::size_t i = 0; i < table.columns(); ++i) {
      const double value = table.number(i);
      row.push_back(std::isnan(value) ? gap : value);
    }
  }
  return out;
}

TEST(DelimitedText, IsSplitByWhatIsThere) {
  const Rows wanted{{0, 1.5}, {2, -0.5}};
  for (const std::string text : {"t,E\n0,1.5\n2,-0.5\n",
                                 "t;E\n0;1.5\n2;-0.5\n",
                                 "t\tE\n0\t1.5\n2\t-0.5\n",
                                 "t E\n0 1.5\n2 -0.5\n",
                                 "t, E\n0, 1.5\n2, -0.5",
                                 " t ;E\n 0 ; 1.5 \n2 ;-0.5\n",
                                 "t  E\n  0 \t 1.5\n2\t-0.5  \n",
                                 "t,E\n+0,+1.5\n2,-.5\n",
                                 "t;E\n0;1,5\n2;-0,5\n",
                                 "t\tE\n0\t1,5\n2\t-0,5\n",
                                 "t E\n0 1,5\n2 -0,5\n",
                                 "t,E\n0,\"1,5\"\n2,\"-0,5\"\n",
                                 "t,E\r\n0,1.5\r\n2,-0.5\r\n",
                                 "t,E\r0,1.5\r2,-0.5",
                                 "\xef\xbb\xbft,E\n0,1.5\n2,-0.5\n",
                                 "# a\n\nt,E\n  # b\n0,1.5 # c\n,\n2,-0.5\n\n#",
                                 "sep=;\nt;E\n0;1,5\n2;-0,5\n",
                                 "\xef\xbb\xbfsep=,\r\nt,E\r\n0,1.5\r\n2,-0.5\r\n",
                                 "sep=\t\nt\tE\n0\t1.5\n2\t-0.5\n",
                                 "\"t\",\"E\"\n\"0\",\"1.5\"\n2,\"-0.5\"\n",
                                 "t,E,\n0,1.5,\n2,-0.5,,\n"}) {
    const auto found = read(text);
    EXPECT_THAT(found.problems, IsEmpty()) << text;
    EXPECT_THAT(found.names, ElementsAre("t", "E")) << text;
    EXPECT_EQ(found.rows, wanted) << text;
  }
}

TEST(DelimitedText, NeedsNoNames) {
  EXPECT_EQ(read("0,1\n2,3\n").rows, (Rows{{0, 1}, {2, 3}}));
  EXPECT_EQ(read(",7.0,-13.9\n,7.1,-14\n").rows, (Rows{{gap, 7, -13.9}, {gap, 7.1, -14}}));
  EXPECT_EQ(read("5\n6\n").rows, (Rows{{5}, {6}}));
  EXPECT_EQ(read("0,1,\n1,2,3\n").rows, (Rows{{0, 1, gap}, {1, 2, 3}}));
  EXPECT_EQ(read("NaN,NaN\n1,2\n").rows, (Rows{{gap, gap}, {1, 2}}));
  EXPECT_THAT(read("1,2\n3,4\n", {.delimiter = {}, .decimal_comma = {}, .names = true}).names,
              ElementsAre("1", "2"));
  EXPECT_THAT(read("").rows, IsEmpty());
  EXPECT_THAT(read("\n# nothing\n").rows, IsEmpty());
}

TEST(DelimitedText, TakesWhatItIsGiven) {
  const TextDialect dialect{.delimiter = ';', .decimal_comma = true, .names = false};
  EXPECT_EQ(read("1;2\n3;4,5\n", dialect).rows, (Rows{{1, 2}, {3, 4.5}}));
  EXPECT_EQ(read("1;2.5\n", dialect).problems.size(), 1u);
}

TEST(DelimitedText, HasQuotesAsInRfc4180) {
  const auto found = read("\"a \"\"b\"\"\",\"c\r\nd,e\",f\n1,2,3\n");
  EXPECT_THAT(found.names, ElementsAre("a \"b\"", "c\r\nd,e", "f"));
  EXPECT_EQ(found.rows, (Rows{{1, 2, 3}}));
  EXPECT_THAT(found.lines, ElementsAre(3));
}

TEST(DelimitedText, HasGaps) {
  EXPECT_EQ(read("t,x\n0,\n1,NaN\n2,nan\n3,4\n").rows, (Rows{{0, gap}, {1, gap}, {2, gap}, {3, 4}}));
}

TEST(DelimitedText, HasGapsAsProgramsWriteThem) {
  for (const std::string cell :
       {"NaN", "-nan", "-NaN(ind)", "1.#QNAN", "-1.#IND", "1.#INF", "#N/A", "OVLD", "Ovld"}) {
    const auto found = read("t,x\n0,1\n1," + cell + "\n");
    EXPECT_THAT(found.problems, IsEmpty()) << cell;
    EXPECT_EQ(found.rows, (Rows{{0, 1}, {1, gap}})) << cell;
  }
}

TEST(DelimitedText, NamesLineAndColumnOfWhatIsWrong) {
  auto found = read("t,E\n0,1\n\n1,x\n2,inf\n3,4,5\n4\n");
  ASSERT_EQ(found.problems.size(), 4u);
  EXPECT_EQ(found.problems[0].path, "/csv");
  EXPECT_EQ(found.problems[0].message, "line 4: column 2 (E) is not a number");
  EXPECT_EQ(found.problems[0].given, "x");
  EXPECT_EQ(found.problems[1].message, "line 5: column 2 (E) is not a number");
  EXPECT_EQ(found.problems[2].message, "line 6: has 3 columns, not 2 as the first row");
  EXPECT_EQ(found.problems[3].message, "line 7: has 1 columns, not 2 as the first row");
  found = read("t,E\n0,\"1\"2\n1,2\n");
  ASSERT_EQ(found.problems.size(), 1u);
  EXPECT_THAT(found.problems[0].message, HasSubstr("line 2: column 2 goes on behind its closing quote"));
  found = read("t,E\n0,\"1\n1,2\n");
  ASSERT_EQ(found.problems.size(), 1u);
  EXPECT_THAT(found.problems[0].message, HasSubstr("line 2: column 2 has a quote that is not closed"));
  for (const std::string number : {"0x10", "1e", "--1", "+-1", "1.2.3", "1 2", "infinity", "1e999", "1,5"})
    EXPECT_EQ(read("t;E\n0;1.0\n1;" + number + "\n").problems.size(), 1u) << number;
  EXPECT_EQ(
      read("t,E\n" + std::string(20, 'x') + "," + "\n0,x\n1,x\n2,x\n3,x\n4,x\n5,x\n6,x\n").problems.size(),
      5u);
}

TEST(DelimitedText, TellsOnceOfLinesAboveTheTable) {
  for (const std::string above : {"% a comment", "Sample: PZT", "Sample,PZT"}) {
    const auto found = read(above + "\nt,E,x\n0,1,2\n1,2,3\n");
    ASSERT_EQ(found.problems.size(), 1u) << above;
    EXPECT_THAT(found.problems[0].message, HasSubstr("line 2: has 3 columns, not "));
    EXPECT_THAT(found.problems[0].hint, HasSubstr("put # before"));
  }
  EXPECT_EQ(read("sep=;\nt;E\n0;1\n1;x\n").problems[0].message, "line 4: column 2 (E) is not a number");
}

TEST(DelimitedText, HasOneDecimalMark) {
  const auto found = read("t;E\n0;1\n1;2,5\n2;3.5\n");
  ASSERT_EQ(found.problems.size(), 1u);
  EXPECT_EQ(found.problems[0].message, "line 4: column 2 (E) is not a number");
  EXPECT_EQ(found.problems[0].hint, "the decimal mark of this table is ','");
}

TEST(DelimitedText, DoesNotGuessWhatACommaBetweenCommasIs) {
  const std::string text = "t,E\n0,\"1,500\"\n1,2\n";
  ASSERT_EQ(read(text).problems.size(), 1u);
  EXPECT_THAT(read(text).problems[0].hint, HasSubstr("decimal mark"));
  EXPECT_EQ(read(text, {.delimiter = {}, .decimal_comma = true, .names = {}}).rows, (Rows{{0, 1.5}, {1, 2}}));
  EXPECT_EQ(read("t,E\n\"0,5\",\"1,500\"\n1,2\n").rows, (Rows{{0.5, 1.5}, {1, 2}}));
}

// Whatever is written is read again, in every dialect.
TEST(DelimitedText, GivesBackWhatWasWritten) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int> small(0, 5);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 500; ++trial) {
    const char delimiter = ",;\t "[small(random) % 4];
    const bool comma = delimiter != ',' && small(random) < 2;
    const auto end = std::array<std::string, 3>{"\n", "\r\n", "\r"}.at(static_cast<std::size_t>(trial % 3));
    const std::size_t columns = 2 + static_cast<std::size_t>(small(random));
    std::string text;
    Rows rows(1 + static_cast<std::size_t>(small(random)));
    for (auto& row : rows) {
      for (std::size_t c = 0; c < columns; ++c) {
        row.push_back(normal(random));
        char buffer[40];
        std::snprintf(buffer, sizeof buffer, "%.17g", row.back());
        std::string cell = buffer;
        if (comma) std::replace(cell.begin(), cell.end(), '.', ',');
        if (small(random) == 0) cell = "\"" + cell + "\"";
        text += (c > 0 ? std::string(1, delimiter) : "") + cell;
      }
      text += end;
      if (small(random) == 0) text += "# a remark" + end;
    }
    const auto found = read(text);
    EXPECT_THAT(found.problems, IsEmpty()) << text;
    EXPECT_EQ(found.rows, rows) << text;
  }
}

}  // namespace
}  // namespace ferrobench
