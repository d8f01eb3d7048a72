# Runs while installing: copies the headers below MAPMEND_HEADERS_FROM to MAPMEND_HEADERS_TO (below the prefix), where
# "libs/..." is "mapmend/...".
set(mapmend_to "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/${MAPMEND_HEADERS_TO}")
file(GLOB_RECURSE mapmend_headers RELATIVE ${MAPMEND_HEADERS_FROM} ${MAPMEND_HEADERS_FROM}/*.h)
foreach(mapmend_header ${mapmend_headers})
  file(READ ${MAPMEND_HEADERS_FROM}/${mapmend_header} mapmend_text)
  string(REPLACE "#include \"libs/" "#include \"mapmend/" mapmend_text "${mapmend_text}")
  set(mapmend_old "")
  if(EXISTS ${mapmend_to}/${mapmend_header})
    file(READ ${mapmend_to}/${mapmend_header} mapmend_old)
  endif()
  if(NOT mapmend_text STREQUAL mapmend_old)  # so that what includes it is not built anew for nothing
    message(STATUS "Installing: ${mapmend_to}/${mapmend_header}")
    file(WRITE ${mapmend_to}/${mapmend_header} "${mapmend_text}")
  endif()
  list(APPEND CMAKE_INSTALL_MANIFEST_FILES ${CMAKE_INSTALL_PREFIX}/${MAPMEND_HEADERS_TO}/${mapmend_header})
endforeach()
