/* The analogue inputs; port.h's convert is here. */
#ifndef SENSES_H
#define SENSES_H

void senses_start(void);

#endif
