// A program that cannot do what it is asked: exit code 1, and one line on stderr that begins with its name and holds all the words.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "harness.hpp"

namespace trocar::testing {

using Words = std::vector<std::string>;

inline constexpr double answer_s = 30.0;

inline void expect_refusal(const Scratch& scratch, const std::string& name, const Words& arguments, const Words& words) {
  Program program(scratch, name, arguments);
  SCOPED_TRACE(name + (arguments.empty() ? std::string() : " " + arguments.front()));
  EXPECT_EQ(program.wait(answer_s), 1) << program.out();
  const std::string said = program.errors();
  EXPECT_EQ(said.rfind(name + ": ", 0), 0U) << said;
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  EXPECT_EQ(said.find("  "), std::string::npos) << said;
  for (const std::string& word : words) EXPECT_NE(said.find(word), std::string::npos) << "misses \"" << word << "\": " << said;
}

}  // namespace trocar::testing
