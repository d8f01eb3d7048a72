# mapmend_embed_text(TARGET HEADER NAME FILE [PART ...]): HEADER, in the target's include path, defines
# mapmend::NAME as the text of FILE, in which @PART@ stands for the text of the file PART beside it.
function(mapmend_embed_text target header name file)
  file(READ ${CMAKE_CURRENT_SOURCE_DIR}/${file} text)
  set(sources ${CMAKE_CURRENT_SOURCE_DIR}/${file})
  get_filename_component(folder ${CMAKE_CURRENT_SOURCE_DIR}/${file} DIRECTORY)
  foreach(part ${ARGN})
    file(READ ${folder}/${part} content)
    string(REPLACE "@${part}@" "${content}" text "${text}")
    list(APPEND sources ${folder}/${part})
  endforeach()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${sources})
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/embedded/${header} @ONLY CONTENT
"#pragma once

// Made of @file@; change that.
namespace mapmend {

inline constexpr char @name@[] = R\"embedded(@text@)embedded\";

}  // namespace mapmend
")
  target_include_directories(${target} SYSTEM PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/embedded)
endfunction()
