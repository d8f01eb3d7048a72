# Libraries that Debian 12 has without a CMake package, or with one that asks for too much, as imported targets. Used by the
# build, and by mapmendConfig.cmake of an installation. What is not found is listed in MAPMEND_MISSING_LIBRARIES.
set(MAPMEND_MISSING_LIBRARIES "")

# mapmend_foreign_library(TARGET HEADER LIBRARY ... [SUFFIXES INCLUDE_FOLDER ...]): an imported target of shared libraries.
function(mapmend_foreign_library target header)
  cmake_parse_arguments(ARG "" "" "SUFFIXES" ${ARGN})
  if(TARGET ${target})
    return()
  endif()
  string(MAKE_C_IDENTIFIER "MAPMEND_${target}" name)
  find_path(${name}_INCLUDE_DIR ${header} PATH_SUFFIXES ${ARG_SUFFIXES})
  mark_as_advanced(${name}_INCLUDE_DIR)
  add_library(${target} INTERFACE IMPORTED)
  set(missing ${MAPMEND_MISSING_LIBRARIES})
  if(${name}_INCLUDE_DIR)
    target_include_directories(${target} SYSTEM INTERFACE ${${name}_INCLUDE_DIR})
  else()
    list(APPEND missing ${header})
  endif()
  foreach(library ${ARG_UNPARSED_ARGUMENTS})
    find_library(${name}_${library}_LIBRARY ${library})
    mark_as_advanced(${name}_${library}_LIBRARY)
    if(${name}_${library}_LIBRARY)
      target_link_libraries(${target} INTERFACE ${${name}_${library}_LIBRARY})
    else()
      list(APPEND missing lib${library})
    endif()
  endforeach()
  set(MAPMEND_MISSING_LIBRARIES "${missing}" PARENT_SCOPE)
endfunction()

# RE2 comes without a CMake package; so does LCM, and its pkg-config file drags in glib's headers.
mapmend_foreign_library(re2::re2 re2/re2.h re2)
mapmend_foreign_library(lcm::lcm lcm/lcm-cpp.hpp lcm)

# OpenCV's CMake package comes only with libopencv-dev, which pulls in VTK and a desktop.
mapmend_foreign_library(mapmend_opencv opencv2/core.hpp
  opencv_core opencv_imgproc opencv_imgcodecs opencv_videoio opencv_features2d opencv_calib3d SUFFIXES opencv4)

# Videos: OpenCV's own reader cannot choose a track, and knows neither edit lists nor times of its frames to the end.
mapmend_foreign_library(mapmend_libav libavformat/avformat.h avformat avcodec avutil swscale)

# Pictures of the ground as GeoTIFF.
mapmend_foreign_library(mapmend_gdal gdal_priv.h gdal SUFFIXES gdal)

# JPEG: tells when a part of an image is missing. Capture times: EXIF.
mapmend_foreign_library(mapmend_turbojpeg turbojpeg.h turbojpeg)
mapmend_foreign_library(mapmend_exiv2 exiv2/exiv2.hpp exiv2)

# Positions on the earth; files of positions in XML.
mapmend_foreign_library(mapmend_geographic GeographicLib/LocalCartesian.hpp GeographicLib)
mapmend_foreign_library(mapmend_pugixml pugixml.hpp pugixml)

# GStreamer itself, only to check a pipeline before OpenCV opens it: with a wrong one OpenCV 4.6 waits for ever.
find_package(PkgConfig QUIET)
if(PKG_CONFIG_FOUND AND NOT TARGET PkgConfig::GSTREAMER)
  pkg_check_modules(GSTREAMER QUIET IMPORTED_TARGET gstreamer-1.0)
endif()
if(NOT TARGET PkgConfig::GSTREAMER)
  list(APPEND MAPMEND_MISSING_LIBRARIES gstreamer-1.0)
endif()
