#pragma once

#include <string>
#include <vector>

// Which images a folder holds, and in which order they were taken: one answer for whoever counts, reads or names them.
namespace mapmend {

struct ImageList {
  std::vector<std::string> files;
  // Lines for a person: what was passed over, or in which order the images are taken if not that of the plain names.
  std::vector<std::string> notes;
};

// True for the endings that OpenCV reads: jpg, jpeg, png, bmp, tif, tiff, pgm, ppm, webp; in any case of letters.
bool HasImageName(const std::string& path);

// True for the endings that cameras give their videos, in any case of letters.
bool HasVideoName(const std::string& path);

// Order in which people number files: digits count as numbers, so frame2 comes before frame10.
bool NaturalLess(const std::string& a, const std::string& b);

// The images of a folder in natural order of their names. A folder without images of its own may hold them in
// subfolders, as memory cards do (DCIM/100MEDIA, DCIM/101MEDIA). Hidden files (among them ._NAME of macOS), folders and
// links that lead nowhere are no images, whatever they are called; nor is
// "DSC1 (2).jpg" or "DSC1 - Copy.jpg" beside a DSC1.jpg with the same bytes. A file that cannot be read is one: it
// counts as a frame. Throws std::runtime_error with one line if the folder cannot be read or holds no image; it says
// what there is instead, where people may have meant that.
ImageList ListImages(const std::string& folder);

// The images of a flight's inputs in the order of its frames, if they are folders of images or images; empty if one of
// them is something else.
std::vector<std::string> ImagesOf(const std::vector<std::string>& inputs);

// The same for images that were named one by one.
ImageList SortImages(std::vector<std::string> files);

}  // namespace mapmend
