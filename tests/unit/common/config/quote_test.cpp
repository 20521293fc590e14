#include "common/config/quote.hpp"

#include <gtest/gtest.h>

namespace trocar::config {
namespace {

TEST(Quote, EscapesWhatWouldEndTheText) {
  EXPECT_EQ(quote("left01.jpg"), "\"left01.jpg\"");
  EXPECT_EQ(quote("a\"b\\c\nd\x7F"), "\"a\\\"b\\\\c\\u000Ad\\u007F\"");
}

TEST(Quote, KeepsUtf8AndReplacesEveryByteThatIsNot) {
  const std::string replaced = "\xEF\xBF\xBD";
  for (const std::string good : {"\xC3\xA9", "\xE2\x82\xAC", "\xF0\x9F\x93\xB7", "\xED\x9F\xBF", "\xF4\x8F\xBF\xBF"})
    EXPECT_EQ(quote(good), "\"" + good + "\"");
  EXPECT_EQ(quote("\xFFz"), "\"" + replaced + "z\"");
  EXPECT_EQ(quote("\xC3("), "\"" + replaced + "(\"");
  EXPECT_EQ(quote("\xE2\x82"), "\"" + replaced + replaced + "\"");
  for (const std::string bad : {"\xED\xA0\x80", "\xE0\x80\x80", "\xC0\x80"})  // surrogate, overlong
    EXPECT_EQ(quote(bad).find(bad), std::string::npos);
}

}  // namespace
}  // namespace trocar::config
