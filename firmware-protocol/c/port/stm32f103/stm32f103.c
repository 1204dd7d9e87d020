/* Registers and their bits are those of ST's reference manual RM0008. */
#include "stm32f103.h"

#include "port.h"

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define BIT(n) (UINT32_C(1) << (n))

#define RCC_CR REGISTER(0x40021000u)
#define RCC_CFGR REGISTER(0x40021004u)
#define RCC_APB2ENR REGISTER(0x40021018u)
#define RCC_APB1ENR REGISTER(0x4002101Cu)
#define FLASH_ACR REGISTER(0x40022000u)
#define GPIOA_CRH REGISTER(0x40010804u)
#define SYST_CSR REGISTER(0xE000E010u)
#define SYST_RVR REGISTER(0xE000E014u)
#define SYST_CVR REGISTER(0xE000E018u)

#define CAN(offset) REGISTER(0x40006400u + (offset))
#define CAN_MCR CAN(0x000u)
#define CAN_MSR CAN(0x004u)
#define CAN_TSR CAN(0x008u)
#define CAN_RF0R CAN(0x00Cu)
#define CAN_ESR CAN(0x018u)
#define CAN_BTR CAN(0x01Cu)
#define CAN_TI0R CAN(0x180u)
#define CAN_TDT0R CAN(0x184u)
#define CAN_TDL0R CAN(0x188u)
#define CAN_TDH0R CAN(0x18Cu)
#define CAN_RI0R CAN(0x1B0u)
#define CAN_RDT0R CAN(0x1B4u)
#define CAN_RDL0R CAN(0x1B8u)
#define CAN_RDH0R CAN(0x1BCu)
#define CAN_FMR CAN(0x200u)
#define CAN_FS1R CAN(0x20Cu)
#define CAN_FA1R CAN(0x21Cu)
#define CAN_F0R1 CAN(0x240u)
#define CAN_F0R2 CAN(0x244u)

/* A cycle of 72 MHz is 125/9 ns. */
#define CYCLES_NUMERATOR 125u
#define CYCLES_DENOMINATOR 9u
#define SYSTICK_MASK 0xFFFFFFu

static void wait_for(volatile const uint32_t *from, uint32_t bits, uint32_t value)
{
    while ((*from & bits) != value) {
    }
}

/* 72 MHz from the crystal, APB1 at half of it. */
static void start_clocks(void)
{
    FLASH_ACR = BIT(4) | 2u; /* Prefetch, two wait states. */
    RCC_CR |= BIT(16);       /* HSEON, then HSERDY. */
    wait_for(&RCC_CR, BIT(17), BIT(17));
    RCC_CFGR = 7u << 18 | BIT(16) | 4u << 8; /* PLLMUL 9, PLLSRC the crystal, PPRE1 2. */
    RCC_CR |= BIT(24);                       /* PLLON, then PLLRDY. */
    wait_for(&RCC_CR, BIT(25), BIT(25));
    RCC_CFGR |= 2u; /* SW, then SWS: the PLL. */
    wait_for(&RCC_CFGR, 3u << 2, 2u << 2);
    RCC_APB2ENR |= BIT(2);  /* Port A. */
    RCC_APB1ENR |= BIT(25); /* CAN. */
}

/* 1 Mbit/s: 36 MHz / 2 / (1 + 15 + 2), sampled at 16/18 of a bit. All frames come into FIFO 0. */
static void start_can(void)
{
    GPIOA_CRH = (GPIOA_CRH & ~(0xFFu << 12)) | 0xB4u << 12; /* PA11 input, PA12 alternate push-pull. */
    CAN_MCR = BIT(6) | BIT(0);                              /* ABOM, INRQ; SLEEP and TXFP off. */
    wait_for(&CAN_MSR, BIT(0), BIT(0));
    CAN_BTR = 1u << 24 | 1u << 20 | 14u << 16 | 1u; /* SJW 2, TS2 2, TS1 15, BRP 2. */
    CAN_FMR |= BIT(0);
    CAN_FS1R |= BIT(0); /* Bank 0: one mask of 32 bits, all of them ignored. */
    CAN_F0R1 = 0;
    CAN_F0R2 = 0;
    CAN_FA1R |= BIT(0);
    CAN_FMR &= ~BIT(0);
    CAN_MCR &= ~BIT(0);
    wait_for(&CAN_MSR, BIT(0), 0);
}

void stm32f103_start(void)
{
    start_clocks();
    SYST_RVR = SYSTICK_MASK;
    SYST_CVR = 0;
    SYST_CSR = BIT(2) | BIT(0); /* The processor's clock, no interrupt. */
    start_can();
}

/* SysTick counts down 24 bits, 0.23 s: it must be read more often than that, which the loop does. */
uint64_t port_now_ns(void)
{
    static uint64_t cycles;
    static uint32_t last;
    const uint32_t count = SYST_CVR;
    cycles += (last - count) & SYSTICK_MASK;
    last = count;
    return cycles * CYCLES_NUMERATOR / CYCLES_DENOMINATOR;
}

static bool is_bus_off(void)
{
    return (CAN_ESR & BIT(2)) != 0;
}

static bool has_frame(void)
{
    return (CAN_RF0R & 3u) != 0; /* FMP0. */
}

static void put_bytes(uint8_t *to, uint32_t word)
{
    for (int i = 0; i < 4; i++) {
        to[i] = (uint8_t)(word >> (8 * i));
    }
}

static uint32_t word_of(const uint8_t *from)
{
    return from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 | (uint32_t)from[3] << 24;
}

port_result port_receive(resonarm_frame *frame)
{
    if (!has_frame()) {
        return is_bus_off() ? PORT_BUS_OFF : PORT_EMPTY;
    }
    const uint32_t identifier = CAN_RI0R, length = CAN_RDT0R & 0xFu;
    const bool is_extended = (identifier & BIT(2)) != 0;
    *frame = (resonarm_frame){
        .id = is_extended ? identifier >> 3 : identifier >> 21,
        .id_format = is_extended ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD,
        .format = (identifier & BIT(1)) != 0 ? RESONARM_FRAME_REMOTE : RESONARM_FRAME_CLASSIC,
        .length = (uint8_t)(length > 8 ? 8 : length),
    };
    put_bytes(frame->data, CAN_RDL0R);
    put_bytes(frame->data + 4, CAN_RDH0R);
    CAN_RF0R = BIT(5); /* RFOM0: the next. */
    return PORT_DONE;
}

/* Uses one of the three mailboxes, so that frames keep their order. */
port_result port_send(const resonarm_frame *frame)
{
    if (frame->format != RESONARM_FRAME_CLASSIC) {
        return PORT_FAILED; /* bxCAN has no other format. */
    }
    if (is_bus_off()) {
        return PORT_BUS_OFF;
    }
    if ((CAN_TSR & BIT(26)) == 0) { /* TME0. */
        return PORT_EMPTY;
    }
    CAN_TDT0R = frame->length;
    CAN_TDL0R = word_of(frame->data);
    CAN_TDH0R = word_of(frame->data + 4);
    CAN_TI0R = frame->id << 21 | BIT(0); /* TXRQ. */
    return PORT_DONE;
}

void port_wait(uint64_t until_ns)
{
    while (!has_frame() && port_now_ns() < until_ns) {
    }
}

bool port_is_stopped(void)
{
    return false;
}
