# Written by symheli export --target; rewritten by it while this line stays.
#   make         build/TARGET/libonboard.a: what flies, all of this folder
#   make check   the same numbers as Python, in qemu-system-arm; and what a step takes
#   make size    code and data
TARGET ?= @target@
CROSS ?= arm-none-eabi-
QEMU ?= qemu-system-arm

cortex-m4 := -mcpu=cortex-m4 -mfpu=fpv4-sp-d16
cortex-m7 := -mcpu=cortex-m7 -mfpu=fpv5-d16
machine-cortex-m4 := mps2-an386
machine-cortex-m7 := mps2-an500
ifeq ($($(TARGET)),)
$(error TARGET is $(TARGET): expected cortex-m4 or cortex-m7)
endif

# without contraction of products and sums the bits are those of Python
WARNINGS ?= -Wall -Wextra
CFLAGS ?= -O2
FLAGS := $($(TARGET)) -mthumb -mfloat-abi=hard -ffp-contract=off -ffunction-sections \
  -fdata-sections $(WARNINGS) $(CFLAGS)

BUILD := build/$(TARGET)
CHECKS := $(patsubst %.c,%,$(wildcard *_check.c))
PARTS := $(patsubst %.c,$(BUILD)/%.o,$(filter-out $(wildcard *_check.c),$(wildcard *.c)))

all: $(BUILD)/libonboard.a

$(BUILD)/libonboard.a: $(PARTS)
	rm -f $@
	$(CROSS)ar rcs $@ $^

$(PARTS): $(BUILD)/%.o: %.c $(wildcard *.h) | $(BUILD)
	$(CROSS)gcc -std=c99 $(FLAGS) -fstack-usage -c $< -o $@

# the calls of a step are measured
$(BUILD)/%_measured.h: | $(BUILD)
	printf '#include "measure.h"\n#include "$*.h"\n' > $@
	printf '#define $*_update(...) MEASURED($*_update(__VA_ARGS__))\n' >> $@
	printf '#define $*_predict(...) MEASURED($*_predict(__VA_ARGS__))\n' >> $@

$(BUILD)/%_check.elf: %_check.c $(BUILD)/%_measured.h $(BUILD)/libonboard.a $(wildcard board/*)
	$(CROSS)gcc -std=gnu99 $(FLAGS) -I. -Iboard -include $(BUILD)/$*_measured.h -c $< \
	  -o $(BUILD)/$*_check.o
	$(CROSS)gcc -std=gnu99 $(FLAGS) -Iboard --specs=rdimon.specs -nostartfiles -Wl,--gc-sections \
	  -T board/mps2.ld board/startup.c $(BUILD)/$*_check.o $(BUILD)/libonboard.a -lm -o $@

$(BUILD):
	mkdir -p $@

# an instruction is 64 ns, which a timer counts
check: $(CHECKS:%=$(BUILD)/%.elf)
	@for program in $^; do \
	  $(QEMU) -M $(machine-$(TARGET)) -nographic -monitor none -icount shift=6 \
	    -semihosting-config enable=on,target=native -kernel $$program < /dev/null || exit; \
	done

size: $(BUILD)/libonboard.a
	$(CROSS)size -t $<

clean:
	rm -rf build

.PHONY: all check size clean
.SECONDARY:
