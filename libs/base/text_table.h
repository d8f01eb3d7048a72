#pragma once

#include <string>
#include <vector>

// Columns of text as tools and spreadsheets write them, read in one way for all of mapmend's formats.
namespace mapmend {

struct TextRow {
  int line = 0;  // in the file, from 1
  std::vector<std::string> fields;
};

struct TextTable {
  std::vector<TextRow> rows;
  std::string head;      // the names of the columns as the file has them: its last comment before the first row, or a
                         // first row without any number; empty if there is none
  char separator = ' ';  // of the rows: ',' ';' or blank (blanks separate beside commas too)

  // The name of a column, as far as the head tells it; with a head that cannot be split, all of it.
  std::string HeadOf(size_t column) const;
};

// Blank lines, lines of blanks, comments (# or %, indented or not), CRLF and lone CR, a byte order mark, quotes around
// fields: none of them is data. what ("times file") and path stand at the head of messages. Throws std::runtime_error
// with one line if the file cannot be read, is UTF-16, or holds zero bytes.
TextTable ReadTextTable(const std::string& path, const std::string& what);

// A number that fills the whole field ("nan" and "inf" are numbers, too), with a leading + or not.
bool ParseNumber(const std::string& field, double* value);

}  // namespace mapmend
