# Every third-party package, found once. All are Debian packages; scripts/setup installs them.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Ceres 2.1 REQUIRED)
find_package(SQLite3 REQUIRED)
find_package(ZLIB REQUIRED)
find_package(SQLiteCpp REQUIRED)
find_package(CLI11 REQUIRED)
find_package(spdlog REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(nlohmann_json REQUIRED)
find_path(HTTPLIB_INCLUDE_DIR httplib.h REQUIRED)
find_library(HTTPLIB_LIBRARY cpp-httplib REQUIRED)

# RE2 comes without a CMake package in Debian 12.
find_path(RE2_INCLUDE_DIR re2/re2.h REQUIRED)
find_library(RE2_LIBRARY re2 REQUIRED)
add_library(re2::re2 UNKNOWN IMPORTED)
set_target_properties(re2::re2 PROPERTIES
  IMPORTED_LOCATION ${RE2_LIBRARY}
  INTERFACE_INCLUDE_DIRECTORIES ${RE2_INCLUDE_DIR})

# Of systemd only the notices to a service manager.
find_path(SYSTEMD_INCLUDE_DIR systemd/sd-daemon.h REQUIRED)
find_library(SYSTEMD_LIBRARY systemd REQUIRED)

# GeographicLib ships its find module outside CMake's own path.
list(APPEND CMAKE_MODULE_PATH /usr/share/cmake/geographiclib)
find_package(GeographicLib REQUIRED)

# LCM has no CMake package in Debian, and its pkg-config file drags in glib's headers: find it by hand.
find_path(LCM_INCLUDE_DIR lcm/lcm-cpp.hpp REQUIRED)
find_library(LCM_LIBRARY lcm REQUIRED)
find_program(LCM_GEN lcm-gen REQUIRED)
add_library(lcm::lcm UNKNOWN IMPORTED)
set_target_properties(lcm::lcm PROPERTIES
  IMPORTED_LOCATION ${LCM_LIBRARY}
  INTERFACE_INCLUDE_DIRECTORIES ${LCM_INCLUDE_DIR})

# OpenCV by hand: its CMake package comes only with libopencv-dev, which pulls in VTK and a desktop.
find_path(OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
add_library(mapmend_opencv INTERFACE)
target_include_directories(mapmend_opencv SYSTEM INTERFACE ${OPENCV_INCLUDE_DIR})
foreach(module core imgproc imgcodecs videoio features2d calib3d)
  find_library(OPENCV_${module}_LIBRARY opencv_${module} REQUIRED)
  target_link_libraries(mapmend_opencv INTERFACE ${OPENCV_${module}_LIBRARY})
endforeach()

# GStreamer itself, only to check a pipeline before OpenCV opens it: with a wrong one OpenCV 4.6 waits for ever.
find_package(PkgConfig REQUIRED)
pkg_check_modules(GSTREAMER REQUIRED IMPORTED_TARGET gstreamer-1.0)

# Videos: OpenCV's own reader cannot choose a track, and knows neither edit lists nor times of its frames to the end.
add_library(mapmend_libav INTERFACE)
find_path(LIBAV_INCLUDE_DIR libavformat/avformat.h REQUIRED)
target_include_directories(mapmend_libav SYSTEM INTERFACE ${LIBAV_INCLUDE_DIR})
foreach(library avformat avcodec avutil swscale)
  find_library(LIBAV_${library}_LIBRARY ${library} REQUIRED)
  target_link_libraries(mapmend_libav INTERFACE ${LIBAV_${library}_LIBRARY})
endforeach()

# JPEG: tells when a part of an image is missing. Capture times: EXIF.
foreach(library turbojpeg exiv2)
  find_library(${library}_LIBRARY ${library} REQUIRED)
  add_library(mapmend_${library} INTERFACE)
  target_link_libraries(mapmend_${library} INTERFACE ${${library}_LIBRARY})
endforeach()
