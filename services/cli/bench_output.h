#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/cli/app.h"

namespace flamefield {

// Columns of equal width under headings that carry the units; numbers to the right, the first column to the
// left.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> headings) : rows_{std::move(headings)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

// Three significant digits, or so many decimals; a dash for what is not finite.
std::string short_number(double value);
std::string fixed_number(double value, int decimals);

// One line on stderr for each step; ends the command when Ctrl-C was pressed.
class BenchProgress {
 public:
  BenchProgress(std::string what, const Session& session) : what_(std::move(what)), session_(session) {}
  void operator()(const std::string& step) const;

 private:
  std::string what_;
  const Session& session_;
};

// A folder of its own below the one named, gone when the measurement is. Ends the command when it cannot be.
class BenchFolder {
 public:
  explicit BenchFolder(const std::filesystem::path& below);
  ~BenchFolder();
  BenchFolder(const BenchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace flamefield
